// SPDX-License-Identifier: BSL-1.0
#include "jobs/stop_notifier.hpp"

#include "jobs/worker_threads.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <utility>

namespace cles::runtime {
namespace {

using steady = std::chrono::steady_clock;

constexpr std::chrono::milliseconds min_patience{1};

} // namespace

struct stop_notifier::state : std::enable_shared_from_this<state> {
    // A call that is running.
    struct call {
        notice what;
        steady::time_point begun = steady::now();
        bool blocks = false; // another thread has replaced it
    };

    explicit state(std::chrono::milliseconds max_patience) : patience(max_patience) {}

    // The more calls block, the sooner the next one counts as blocking, so that together they delay the others by some
    // tens of milliseconds at most.
    [[nodiscard]] steady::time_point due() const {
        return current->begun + std::max(patience / (1U << std::min<std::size_t>(blocked, 16)), min_patience);
    }

    // With the lock. Adds a thread that makes calls, or replaces the one that does, if there may be one more.
    bool add_thread() {
        if (ended || working >= max_threads) {
            return false;
        }
        try {
            if (threads.count() <= working) {
                threads.add();
            }
        } catch (const std::system_error&) { // the existing threads have to suffice
            return false;
        }
        ++working;
        boost::asio::post(threads.get_executor(), [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->work();
            }
        });
        return true;
    }
    // With the lock. Whether anything waits for the call that is running.
    [[nodiscard]] bool is_awaited() const { return !waiting.empty() || (ending && current != nullptr); }
    // With the lock. One thread makes the calls, and one watches whether it blocks.
    void ensure_threads() {
        const std::size_t wanted = blocked + (is_awaited() ? 1 : 0) + (current == nullptr ? 0 : 1);
        while (working < wanted && add_thread()) {
        }
    }

    void work() {
        std::unique_lock lock{mutex};
        while (!ended && working <= blocked + 2) {
            if (!is_awaited()) {
                changed.wait(lock);
            } else if (current == nullptr) {
                make_call(lock);
            } else if (steady::now() < due()) {
                changed.wait_until(lock, due());
            } else {
                replace_blocked(lock);
            }
        }
        --working;
    }

    void make_call(std::unique_lock<std::mutex>& lock) {
        const auto mine = std::make_shared<call>(call{.what = std::move(waiting.front())});
        waiting.pop_front();
        current = mine;
        ++calls;
        ensure_threads();
        lock.unlock();
        try {
            mine->what.callback();
        } catch (...) {
            log(*mine, log_level::warning, "its on_stop callback threw");
        }
        mine->what.callback = nullptr;
        lock.lock();
        --calls;
        if (mine->blocks) {
            if (--blocked == 0) {
                exhausted = false;
            }
        } else {
            current = nullptr;
        }
        changed.notify_all();
    }

    void replace_blocked(std::unique_lock<std::mutex>& lock) {
        const auto slow = std::exchange(current, nullptr);
        slow->blocks = true;
        ++blocked;
        ensure_threads();
        changed.notify_all();
        const auto blocked_threads = blocked;
        const bool last = blocked + 1 >= max_threads && !std::exchange(exhausted, true);
        lock.unlock();
        log(*slow, log_level::warning, "its on_stop callback does not return; another thread notifies the other jobs");
        if (last) {
            log(*slow, log_level::error,
                std::to_string(blocked_threads) + " on_stop callbacks do not return: one more would delay all others");
        }
        lock.lock();
    }

    static void log(const call& of, log_level level, const std::string& text) {
        if (of.what.log) {
            of.what.log(level, text);
        }
    }

    const std::chrono::milliseconds patience;
    worker_threads threads{0};
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<notice> waiting;
    std::shared_ptr<call> current; // the call that is running; null: the next thread makes the next call
    std::size_t working = 0;       // threads in `work`
    std::size_t calls = 0;         // running, including those that block
    std::size_t blocked = 0;
    bool exhausted = false; // reported, and not again until all have returned
    bool ending = false;
    bool ended = false;
};

stop_notifier::stop_notifier(std::chrono::milliseconds patience) : state_(std::make_shared<state>(patience)) {}

stop_notifier::~stop_notifier() { close(std::chrono::milliseconds{0}); }

bool stop_notifier::notify(notice what) {
    auto& s = *state_;
    const std::lock_guard lock{s.mutex};
    if (s.ended) {
        return false;
    }
    s.waiting.push_back(std::move(what));
    s.ensure_threads();
    s.changed.notify_all();
    return true;
}

std::size_t stop_notifier::close(std::chrono::milliseconds limit) {
    auto& s = *state_;
    const auto begun = steady::now();
    const auto end = begun + limit;
    std::deque<notice> dropped;
    std::size_t busy = 0;
    {
        std::unique_lock lock{s.mutex};
        if (s.ended) {
            return 0;
        }
        s.ending = true;
        s.ensure_threads(); // so that a last call that blocks is noticed too
        s.changed.notify_all();
        s.changed.wait_until(lock, end, [&] { return s.waiting.empty() && s.calls == 0; });
        s.changed.wait_until(lock, begun + min_close_time, [&] { return s.waiting.empty() && s.calls == s.blocked; });
        dropped.swap(s.waiting);
        s.ended = true;
        busy = s.calls;
        s.changed.notify_all();
    }
    dropped.clear();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - steady::now());
    return s.threads.stop(std::max(left, std::chrono::milliseconds{0}), busy);
}

} // namespace cles::runtime
