// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/scoped_flag.hpp"
#include "node/node_state.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace cles::core {

/// Decides whether updates go out in this turn of the executor, or wait for more, so that one write carries them all.
/// They wait while each turn brings more, until there are `most`, or `longest` has passed since updates last went out.
/// So a single update after a pause goes out at once, unless several went out together before, as from a program that
/// publishes them all in each of its cycles.
class update_coalescer {
  public:
    static constexpr std::chrono::microseconds longest{100};
    static constexpr std::uint64_t most = 32; // half of what is kept for a subscriber by default

    /// Whether an update that was published outside of a turn can go out at once: none went out for a while, and the
    /// last one was alone.
    [[nodiscard]] bool alone(time_point now) noexcept {
        followed_ = followed_ || !is_late(now);
        return !several_ && !followed_;
    }
    /// Whether updates wait. `published`: the number so far, including those that have gone out.
    [[nodiscard]] bool waits(std::uint64_t published, time_point now) noexcept {
        if (published == seen_) {
            return false;
        }
        seen_ = published;
        return !is_late(now) && published - gone_ < most;
    }
    /// All updates so far have gone out, `published` in number.
    void gone(std::uint64_t published, time_point now) noexcept {
        several_ = std::exchange(followed_, false) || published - gone_ > 1;
        seen_ = published;
        gone_ = published;
        gone_at_ = now;
    }

  private:
    [[nodiscard]] bool is_late(time_point now) const noexcept { return !gone_at_ || now - *gone_at_ >= longest; }

    std::uint64_t seen_ = 0;
    std::uint64_t gone_ = 0;
    std::optional<time_point> gone_at_; // when the last update went out
    bool followed_ = false;             // another update followed soon after it
    bool several_ = false;              // updates went out together, or in close succession
};

/// Hands the new updates of these topics to their subscribers. Then publishes the updates that wait for capacity there.
void send_updates(unsent_topics& unsent, publications& published, time_point now);

/// A link, whose output is written in turns.
class flushable {
  public:
    flushable() = default;
    flushable(const flushable&) = delete;
    flushable& operator=(const flushable&) = delete;

    /// Writes pending output, and continues serving and publishing if there is capacity again.
    virtual void flush() = 0;
    /// Writes pending output without running handlers. Returns false if `flush` would do more.
    [[nodiscard]] virtual bool write() = 0;
    /// Whether at most one request of this node waits for its reply here.
    [[nodiscard]] virtual bool has_single_request() = 0;
    /// The same, and whether no request of the peer is in progress.
    [[nodiscard]] virtual bool has_single_message() = 0;
    /// Returns a reference that keeps it alive.
    [[nodiscard]] virtual std::shared_ptr<flushable> share() = 0;

  protected:
    ~flushable() = default;

  private:
    friend class flush_scheduler;
    bool waits_ = false; // for the next turn
};

/// What `flush_scheduler` needs from a service.
class flush_host {
  public:
    flush_host() = default;
    flush_host(const flush_host&) = delete;
    flush_host& operator=(const flush_host&) = delete;

    /// Schedules a call of `flush_scheduler::turn` after the current code.
    virtual void post_flush() = 0;
    /// Whether there are no more turns.
    [[nodiscard]] virtual bool stopped() const = 0;
    /// Continues requests that wait to be forwarded or to start here. Handlers run.
    virtual void drain_routing(time_point now) = 0;
    /// Continues a graceful shutdown, if what it waits for has happened. Called after each turn.
    virtual void check_shutdown() = 0;

  protected:
    ~flush_host() = default;
};

/// Schedules the writes of a service: output is collected and written in a turn of its executor after the current code.
///
/// A single update or request of the program goes out at once, inside the call that makes it: there is nothing to
/// combine it with, and the caller may do much before the next turn, such as setting a timer. This does not apply while
/// a handler runs, until it first waits, so that a reply that it gives goes first. It also applies to a message that a
/// node forwards.
class flush_scheduler {
  public:
    flush_scheduler(flush_host& host, node_state& node) noexcept : host_(host), node_(node) {}
    flush_scheduler(const flush_scheduler&) = delete;
    flush_scheduler& operator=(const flush_scheduler&) = delete;

    /// Schedules a turn after the current code.
    void schedule_turn();
    /// Has `which` flushed in that turn.
    void flush_soon(flushable& which);
    /// Runs a turn. Exceptions of handlers propagate; the rest gets another turn.
    void turn();
    /// Runs a function of the program that publishes or sends requests. Its exceptions propagate. No handler and no
    /// completion runs inside.
    template <class F>
    void run_user_call(F&& call) {
        if (scheduled_ || serving_) {
            std::forward<F>(call)();
            return;
        }
        try {
            {
                const scoped_flag during{scheduled_}; // what waits is handled below
                std::forward<F>(call)();
            }
            write_single_messages();
        } catch (...) {
            request_flush_if_pending();
            throw;
        }
        request_flush_if_pending();
    }
    /// Processes a line of a link, which may have other links send something. That goes out at once if nothing else is
    /// in progress there, and `may_write` says so. Exceptions propagate.
    template <class F, class Condition>
    void run_line(F&& process, Condition&& may_write) {
        if (scheduled_) {
            process();
            return;
        }
        try {
            {
                const scoped_flag during{collecting_};
                process();
            }
            if (!waiting_.empty() && may_write()) {
                flush_waiting([](flushable& one) { return one.has_single_message() && one.write(); });
            }
        } catch (...) {
            request_flush_if_pending();
            throw;
        }
        request_flush_if_pending();
    }
    /// Flushes for the last time. There are no more turns.
    void stop();

    /// Marks that a handler runs. Do not hold it while the handler waits: the whole node shares one mark.
    [[nodiscard]] scoped_flag serving() noexcept { return scoped_flag{serving_}; }

  private:
    /// Calls `flush` for each link that waits now, without those that are added meanwhile; true: it is done. During the
    /// call, it may start to wait again. Links that were not done, or not reached because `flush` threw, wait on.
    template <class F>
    void flush_waiting(F&& flush) {
        auto these = std::exchange(waiting_, std::exchange(spare_, {}));
        const auto keep_rest = [&] {
            std::erase(these, nullptr);
            if (!these.empty()) {
                std::ranges::move(waiting_, std::back_inserter(these));
                waiting_.swap(these);
                these.clear();
            }
            spare_ = std::move(these);
        };
        try {
            for (auto& place : these) {
                auto one = std::exchange(place, nullptr);
                one->waits_ = false;
                if (!flush(*one) && !one->waits_) {
                    one->waits_ = true;
                    place = std::move(one);
                }
            }
        } catch (...) {
            keep_rest();
            throw;
        }
        keep_rest();
    }
    void run_turn();
    void write_single_messages();
    /// Hands published updates to their subscribers. Returns the total number so far; nothing if there were none, or if
    /// they wait for more.
    std::optional<std::uint64_t> publish(bool alone);
    void request_flush_if_pending();

    flush_host& host_;
    node_state& node_;
    update_coalescer coalescer_;
    std::vector<std::shared_ptr<flushable>> waiting_;
    std::vector<std::shared_ptr<flushable>> spare_; // empty, reused for its capacity
    bool scheduled_ = false;  // a turn is posted, or is not needed because what waits is handled afterwards
    bool collecting_ = false; // what waits is handled after the line that is processed
    bool serving_ = false;
};

} // namespace cles::core
