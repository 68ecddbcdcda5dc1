// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>

namespace cles::core {

/// A node that is to be asked what it offers.
struct inquiry {
    std::string where;     ///< the URL at which it is asked; changes only while it is not in the queue
    unsigned failures = 0; ///< of asking it, in a row

  private:
    friend class ask_queue;
    enum class place : std::uint8_t { nowhere, fresh, waiting, asked };
    place at_ = place::nowhere;
    time_point turn_{};
    std::uint64_t order_ = 0;
};

/// Which nodes are asked next, and when. Anybody may announce any number of names, so that asking has bounds: a number
/// at once, a rate of failures, and growing pauses after each failure of a node, and of the URL at which several are
/// said to be. Nodes that were never asked alternate with those whose pause is over, the newest of them first, so that
/// many dead names do not keep a new live one waiting. Each operation costs the logarithm of what waits.
class ask_queue {
  public:
    static constexpr std::size_t at_once = 16;
    static constexpr std::chrono::milliseconds first_pause{2'000}; ///< after a failure; it doubles with each
    static constexpr std::chrono::milliseconds longest_pause{60'000};
    static constexpr std::chrono::milliseconds per_failure{50}; ///< in the long run at most one in so long
    static constexpr std::chrono::milliseconds burst{1'600};    ///< that much of it may be used at once

    ask_queue() = default;
    ask_queue(const ask_queue&) = delete;
    ask_queue& operator=(const ask_queue&) = delete;

    /// It waits for its turn from now on; nothing changes where it does already. It must be removed before it is
    /// destroyed.
    void enter(inquiry& who);
    /// It neither waits nor counts as asked any more.
    void remove(inquiry& who);
    /// Who is to be asked now, and counts as asked from then on; null where nobody is.
    inquiry* next(time_point now);
    /// It has answered, and is not in the queue any more.
    void answered(inquiry& who);
    /// It has not, and waits for another turn. `unreachable`: nothing can be asked at its URL.
    void failed(inquiry& who, bool unreachable, time_point now);
    /// When `next` may have somebody; nothing where it depends on others.
    [[nodiscard]] std::optional<time_point> due() const noexcept;

    /// How many steps have been made through what waits: the measure of its cost.
    [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }

  private:
    using turns = std::set<std::tuple<time_point, std::uint64_t, inquiry*>>;
    struct endpoint {
        std::uint64_t number = 0;
        unsigned failures = 0; // in a row
        time_point closed_until = time_point::min();
        std::size_t asking = 0;
        turns waiting{};
        std::optional<time_point> scheduled{};

        [[nodiscard]] bool is_idle() const noexcept { return failures == 0 && asking == 0 && waiting.empty(); }
    };
    using endpoints = std::unordered_map<std::string, endpoint>;

    [[nodiscard]] time_point open_at() const noexcept { return debt_ - burst; }
    void wait(inquiry& who, time_point turn);
    void schedule(endpoint& e);
    endpoint& at(const inquiry& who);
    void release(const inquiry& who);
    void forget_idle(time_point now);
    void count_as_asked(inquiry& who, endpoint& e);
    inquiry* newest_fresh(time_point now);
    inquiry* oldest_fresh(time_point now);
    inquiry* take_fresh(inquiry& who, time_point now);
    inquiry* take_waiting(time_point now);

    std::map<std::uint64_t, inquiry*> fresh_; // never asked since they were last heard anew, the newest last
    endpoints endpoints_;
    std::set<std::tuple<time_point, std::uint64_t, endpoint*>> schedule_; // where somebody waits and can be asked
    std::size_t asked_ = 0;
    time_point debt_ = time_point::min() + burst; // grows with each failure, and is paid by time
    std::uint64_t last_order_ = 0;
    std::uint64_t steps_ = 0;
    bool newest_next_ = false;
};

} // namespace cles::core
