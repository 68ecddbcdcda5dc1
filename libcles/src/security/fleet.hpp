// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/roster.hpp"

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::security {

/// The group keys that a node has: those of the roster in force, and the previous one where the roster permits it
/// (docs/security.md, "Group keys").
class group_key_ring {
  public:
    /// Adds the keys of a newer roster and forgets those of generations that it refuses.
    void adopt(const roster& in_force, group_keys keys);
    /// The generation with which this node sends; 0 if there is none.
    [[nodiscard]] std::uint32_t current() const noexcept { return current_; }
    /// Null if the generation is refused or not known.
    [[nodiscard]] const secret_bytes* find(std::uint32_t generation) const;
    /// Whether the generation is later than any that this node can know: a newer roster exists.
    [[nodiscard]] bool is_future(std::uint32_t generation) const noexcept { return generation > current_ + 1; }

  private:
    std::uint32_t current_ = 0;
    std::map<std::uint32_t, secret_bytes> keys_;
};

/// The fleet as one node knows it: its own key, the roster in force, the group keys. It decides which roster is in
/// force and tells its observers when that changes. Sans-I/O: the owner stores rosters (`on_adopted`).
///
/// Not thread-safe; used on the node's executor.
class fleet {
  public:
    enum class verdict : std::uint8_t {
        adopted, ///< now in force
        known,   ///< the one in force
        older,   ///< of a lower version
        forked,  ///< another one of the version in force: kept out, reported once
        refused, ///< malformed, of another fleet, or wrongly signed
    };

    /// \param initial in force at first; it need not contain this node
    /// \throws security_error if the roster's member of that key has another name, or group keys cannot be opened
    fleet(std::string name, signing_key own, std::shared_ptr<const roster> initial);

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const signing_key& own_key() const noexcept { return own_; }
    [[nodiscard]] const roster& in_force() const noexcept { return *roster_; }
    [[nodiscard]] std::shared_ptr<const roster> share() const noexcept { return roster_; }
    /// This node's entry; null once it has been removed.
    [[nodiscard]] const member* self() const noexcept { return self_; }
    [[nodiscard]] const group_key_ring& ring() const noexcept { return ring_; }

    /// Takes a roster line from anybody. `why` is set for `refused`.
    verdict offer(std::string_view line, std::string* why = nullptr);

    /// Called after another roster has come into force, with the one before. An observer may end its own observation,
    /// but not offer a roster.
    using observer = std::function<void(const roster& before)>;
    /// Ends with the returned object.
    [[nodiscard]] std::shared_ptr<void> observe(observer changed);

  private:
    void adopt(std::shared_ptr<const roster> next);

    std::string name_;
    signing_key own_;
    std::shared_ptr<const roster> roster_;
    const member* self_ = nullptr;
    group_key_ring ring_;
    bool reported_fork_ = false;
    std::shared_ptr<std::list<observer>> observers_;
};

} // namespace cles::security
