// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/bridge_connection.hpp"
#include "federation/bridge_link.hpp"
#include "federation/bridge_output.hpp"
#include "federation/subject.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace cles::bridging {

/// A noun of another pool.
struct foreign_noun {
    std::string pool;
    std::string node;
    std::string task;
    std::string parameters{}; ///< "/fast", or empty
    std::string requester{};  ///< the member for which it is bound; empty: this node
    std::string target{};     ///< the node as the binding names it: "car1" or "north.car1"
    std::uint32_t link = 0;   ///< the number of the link on which it is bound

    auto operator<=>(const foreign_noun&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
    [[nodiscard]] std::string subject() const { return feed_subject(pool, node, task); }
    /// As the binding names it: "north.car1:localization/fast".
    [[nodiscard]] std::string text() const { return target + ":" + task + parameters; }
    /// On which it is bound.
    [[nodiscard]] bridge_link on() const { return {bridge_link::role::to_pool, pool, link}; }
};

/// The nouns of other pools that this node has bound: subscribes to their subjects, and passes their updates to the
/// node. Updates that arrive before the reply to BIND wait for it.
class foreign_feeds {
  public:
    foreign_feeds(bridge_connection& nats, bridge_output& out) noexcept : nats_(nats), out_(out) {}

    /// The noun is being bound, by the node's request `id`.
    void bind(const foreign_noun& noun, std::uint64_t id);
    /// The node ends the binding.
    void unbind(const foreign_noun& noun);
    /// The request was answered. \param number by which pools know it
    /// \param taker the bridge that holds the binding; empty: not known
    void on_answer(std::uint64_t id, std::uint64_t number, bool is_failure, std::string_view taker);
    /// That bridge has ended what that request had bound: the publisher does not permit it any more.
    void on_unbound(const bridge_id& by, std::uint64_t number);
    /// Nobody waits for the answer any more.
    void cancel(std::uint64_t id);
    void on_update(const subject& about, std::string_view message);
    /// The node has closed the link.
    void close(const bridge_link& link);
    /// The pool has no bridge any more.
    void lose_pool(std::string_view pool);
    /// What that bridge holds is to be bound again.
    void on_lost(const bridge_id& taker, std::string_view why);
    /// The connection is lost. Nothing is reported.
    void clear();

  private:
    static constexpr std::size_t max_held = 64;
    static constexpr std::size_t max_numbers = 64; // as many as its bridge tells apart
    struct binding {
        std::uint64_t id = 0; ///< of the last request; 0: answered
        std::string taker{};
        std::deque<std::uint64_t> numbers{}; ///< of the requests that this bridge has answered
        std::deque<std::string> held{};
    };
    using bindings = std::map<foreign_noun, binding>; // those of one subject are neighbours

    /// \param tells whether its bridge is notified, unless the noun is bound there for the same requester otherwise
    void erase(bindings::iterator which, bool tells);
    template <class Condition>
    void erase_if(Condition concerns, bool tells);
    void end_at(std::string_view taker, const foreign_noun& noun, const std::deque<std::uint64_t>& numbers);

    bridge_connection& nats_;
    bridge_output& out_;
    bindings bound_;
    std::map<std::uint64_t, foreign_noun> asked_; // not answered, by id; the node may have ended the binding
};

} // namespace cles::bridging
