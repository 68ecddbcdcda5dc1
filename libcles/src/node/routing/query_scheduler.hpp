// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>

namespace cles::core {

/// A node to be asked which tasks it offers.
struct query_target {
    std::string where;     ///< its URL; changes only while it is not in the queue
    unsigned failures = 0; ///< of its queries, in a row

  private:
    friend class query_scheduler;
    enum class place : std::uint8_t { nowhere, fresh, waiting, asked };
    place at_ = place::nowhere;
    time_point turn_{};
    std::uint64_t order_ = 0;
};

/// Decides which nodes are asked next, and when. Anyone may announce any number of names, so queries are limited: in
/// number at once, in their rate of failures, and by pauses that grow with each failure of a node and of a URL that
/// several nodes claim. Nodes that were never asked, the newest first, alternate with those whose pause is over, so
/// that many dead names do not delay a new live one. Each step of a node is logarithmic in the number of waiting nodes.
class query_scheduler {
  public:
    static constexpr std::size_t at_once = 16;
    static constexpr std::chrono::milliseconds first_pause{2'000}; ///< after a failure; doubles with each
    static constexpr std::chrono::milliseconds max_pause{60'000};
    static constexpr std::chrono::milliseconds per_failure{50}; ///< average time between failures, at least
    static constexpr std::chrono::milliseconds burst{1'600};    ///< how much of that may be used in advance

    /// `next` calls `on_postponed` for each entered node whose turn comes later, perhaps in a minute, because its URL
    /// is in a pause or is tried by another node after one. `on_postponed` may call `enter`, but not `remove`.
    explicit query_scheduler(std::function<void(query_target&)> on_postponed);
    query_scheduler(const query_scheduler&) = delete;
    query_scheduler& operator=(const query_scheduler&) = delete;

    /// Queues `who`, unless it is queued already. Remove it before destroying it.
    void enter(query_target& who);
    /// Removes it from the queue; it no longer counts as asked. False if it was neither.
    bool remove(query_target& who);
    /// The node to ask now, which counts as asked from then on; null if there is none.
    query_target* next(time_point now);
    /// It has replied, and leaves the queue.
    void answered(query_target& who);
    /// It has not replied, and waits for another turn. `unreachable`: no query gets through to its URL.
    void failed(query_target& who, bool unreachable, time_point now);
    /// When `next` may return a node; nothing if that depends on other events.
    [[nodiscard]] std::optional<time_point> due() const noexcept;

    /// The number of steps made through the queue, as a measure of cost.
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }

  private:
    using turns = std::set<std::tuple<time_point, std::uint64_t, query_target*>>;
    struct endpoint {
        std::uint64_t number = 0;
        unsigned failures = 0; // in a row
        time_point closed_until = time_point::min();
        std::size_t asking = 0;
        turns waiting{};
        std::optional<time_point> scheduled{};

        /// After a failure, one node at a time is asked there.
        [[nodiscard]] bool has_room() const noexcept { return failures == 0 || asking == 0; }
        [[nodiscard]] bool is_idle() const noexcept { return failures == 0 && asking == 0 && waiting.empty(); }
    };
    using endpoints = std::unordered_map<std::string, endpoint>;

    [[nodiscard]] time_point open_at() const noexcept { return debt_ - burst; }
    void wait(query_target& who, time_point turn);
    void schedule(endpoint& e);
    endpoint& at(const query_target& who);
    void release(const query_target& who);
    void forget_idle(time_point now);
    void mark_asked(query_target& who, endpoint& e);
    query_target* take_fresh(time_point now);
    query_target* take_waiting(time_point now);

    std::function<void(query_target&)> on_postponed_;
    std::map<std::uint64_t, query_target*> fresh_; // not asked since it was entered, the newest last
    endpoints endpoints_;
    std::set<std::tuple<time_point, std::uint64_t, endpoint*>> schedule_; // those with a waiting node that can be asked
    std::size_t asked_ = 0;
    time_point debt_ = time_point::min() + burst; // grows with each failure, and shrinks with time
    std::uint64_t last_order_ = 0;
    std::uint64_t steps_ = 0;
    bool newest_ = false; // the last turn was that of the newest
};

} // namespace cles::core
