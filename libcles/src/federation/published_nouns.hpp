// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/subject.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// The nouns of this pool that this bridge publishes for others: each is bound once at the node, for all that want it.
class published_nouns {
  public:
    struct subscriber {
        bridge_id by;
        std::string reply; ///< the subject for the reply to BIND

        auto operator<=>(const subscriber&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
    };
    struct reply {
        std::vector<std::string> to; ///< subjects
        bool ends = false;           ///< nobody is bound any more
        std::string noun;
    };

    /// Somebody binds. Returns the id with which BIND is to be sent to the node; 0 if the reply to an earlier one will
    /// do.
    std::uint64_t bind(const std::string& noun, subscriber who);
    /// The node has replied to the BIND with that id. Empty if there is none.
    [[nodiscard]] reply on_reply(std::uint64_t id, bool is_failure);
    /// Returns whether the node is to end the binding, because nobody else has it.
    bool unbind(const std::string& noun, const bridge_id& by);
    /// Nobody waits any more for the reply to that BIND, which may have been sent. Returns the noun that the node is to
    /// unbind, if any.
    std::optional<std::string> cancel(const subscriber& who);
    /// That bridge is lost. Returns the nouns that the node is to unbind.
    std::vector<std::string> remove(const bridge_id& by);
    /// All bindings have ended. Returns those who had them.
    std::set<bridge_id> clear();

    [[nodiscard]] std::uint64_t next_id() noexcept { return ++last_id_; }
    [[nodiscard]] std::size_t size() const noexcept { return nouns_.size(); }

  private:
    static constexpr std::size_t max_binds = 64; // of one bridge and noun; more are not told apart
    struct entry {
        std::map<bridge_id, std::set<std::string>> bound; ///< with the subjects for replies, since it may bind again
        std::vector<subscriber> waiting;                  ///< for the reply
        std::uint64_t asked = 0;                          ///< the id of the BIND that is not answered; 0: none
    };

    std::map<std::string, entry, std::less<>> nouns_; // "car1:localization/fast"
    std::uint64_t last_id_ = 0;
};

} // namespace cles::bridging
