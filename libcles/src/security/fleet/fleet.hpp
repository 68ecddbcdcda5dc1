// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/group_keys.hpp"
#include "security/fleet/roster.hpp"

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// The fleet as one node knows it: its own key, the roster in force, the group keys. It decides which roster is in
/// force and tells its observers when that changes. Sans-I/O: the owner stores rosters that were adopted.
///
/// Not thread-safe; used on the node's executor.
class fleet {
  public:
    enum class verdict : std::uint8_t {
        adopted, ///< now in force
        known,   ///< the one in force
        older,   ///< of a lower version
        forked,  ///< another one of the version in force: kept out
        refused, ///< malformed, of another fleet, or wrongly signed
    };

    /// \param initial in force at first; it need not contain this node
    /// \throws security_error if the roster's member of that key has another name, or group keys cannot be opened
    fleet(std::string name, signing_key own, std::shared_ptr<const roster> initial);

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const signing_key& own_key() const noexcept { return own_; }
    [[nodiscard]] const roster& in_force() const noexcept { return *roster_; }
    [[nodiscard]] std::shared_ptr<const roster> share() const noexcept { return roster_; }
    /// This node's entry; null once it has been removed, also if its key is listed under another name.
    [[nodiscard]] const member* self() const noexcept { return self_; }
    /// The name of the member of that key that a roster has removed since this was created; null if there is none. The
    /// last ones are known, as many as a roster may have.
    [[nodiscard]] const std::string* find_former(const public_key& key) const;
    /// Whether this node is the same member as in that roster.
    [[nodiscard]] bool is_same_since(const roster& before) const { return self_ != nullptr && before.has(*self_); }
    /// Empty if this node has been removed, or if the roster in force has group keys that it cannot open.
    [[nodiscard]] const group_key_ring& ring() const noexcept { return ring_; }

    /// Takes a roster line from anybody.
    /// \param why set to what is to be reported: for `refused`, for the first `forked` of a version, and for `adopted`
    ///        if this node cannot open the group keys; otherwise to an empty text
    verdict offer(std::string_view line, std::string* why = nullptr);

    /// Called after another roster has come into force, with the one before. An observer may end its own or another
    /// observation and start new ones, but not offer a roster. If one throws, the others are called first.
    using observer = std::function<void(const roster& before)>;
    /// Ends with the returned object, which may outlive the fleet.
    [[nodiscard]] std::shared_ptr<void> observe(observer changed);

  private:
    struct observation;

    [[nodiscard]] verdict judge(std::string_view line, std::string& why);
    [[nodiscard]] std::string adopt(std::shared_ptr<const roster> next);
    void note_removed(const roster& before);
    void notify(const roster& before);

    struct former_member {
        public_key key;
        std::string name;
    };

    std::string name_;
    signing_key own_;
    std::shared_ptr<const roster> roster_;
    const member* self_ = nullptr;
    group_key_ring ring_;
    std::deque<former_member> former_; // oldest first
    bool reported_fork_ = false;
    std::vector<std::weak_ptr<observation>> observers_;
};

} // namespace cles::security
