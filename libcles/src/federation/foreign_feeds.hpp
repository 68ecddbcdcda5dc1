// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge_link.hpp"
#include "federation/subject.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// A noun of another pool.
struct foreign_noun {
    std::string pool;
    std::string node;
    std::string task;
    std::string parameters; ///< "/fast", or empty
    std::string target;     ///< the node as the binding names it: "car1" or "north.car1"
    std::uint32_t link = 0; ///< the number of the link on which it is bound

    auto operator<=>(const foreign_noun&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
    [[nodiscard]] std::string subject() const { return feed_subject(pool, node, task); }
    /// As the binding names it: "north.car1:localization/fast".
    [[nodiscard]] std::string text() const { return target + ":" + task + parameters; }
    /// On which it is bound.
    [[nodiscard]] bridge_link on() const { return {bridge_link::role::to_pool, pool, link}; }
};

/// The nouns of other pools that this node has bound. Updates that arrive before the reply to BIND wait for it.
class foreign_feeds {
  public:
    /// The noun is being bound, by the node's request `id`. Returns whether its subject is to be subscribed.
    bool add(const foreign_noun& noun, std::uint64_t id);
    /// A line for the node.
    struct update {
        bridge_link on;
        std::string line;
    };
    /// The bridge that holds the binding has answered. Returns the updates that have waited.
    std::vector<update> on_bound(std::uint64_t id, std::string_view taker);
    /// BIND was refused, or the node ends the binding.
    struct removed {
        std::string taker;    ///< empty: not known
        bool is_last = false; ///< its subject is not needed any more
        bool is_only = false; ///< the noun is not bound by another name of the node
        foreign_noun noun;
    };
    std::optional<removed> remove(const foreign_noun& noun);
    std::optional<removed> remove(std::uint64_t id);
    /// All that are bound on that link.
    std::vector<removed> remove_link(const bridge_link& link);
    /// All of that pool.
    std::vector<removed> remove_pool(std::string_view pool);
    /// All that this bridge holds.
    std::vector<removed> remove_held(const bridge_id& taker);
    void clear();

    /// An update has arrived. Returns the lines for the node.
    std::vector<update> on_update(const subject& about, std::string_view message);
    [[nodiscard]] bool has(const foreign_noun& noun) const { return bound_.contains(noun); }
    [[nodiscard]] std::size_t size() const noexcept { return bound_.size(); }

  private:
    static constexpr std::size_t max_held = 64;
    struct binding {
        std::uint64_t id = 0; ///< of the request; 0: answered
        std::string taker{};
        std::deque<std::string> held{};
    };
    using bindings = std::map<foreign_noun, binding>; // those of one subject are neighbours

    removed take(bindings::iterator which);
    template <class Condition>
    std::vector<removed> remove_if(Condition concerns);
    [[nodiscard]] bool is_subscribed(const foreign_noun& noun) const;

    bindings bound_;
    std::map<std::uint64_t, foreign_noun> asked_; // not answered, by id
};

} // namespace cles::bridging
