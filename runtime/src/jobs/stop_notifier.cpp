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

constexpr std::chrono::milliseconds least_patience{1};

} // namespace

struct stop_notifier::inside : std::enable_shared_from_this<inside> {
    // A call that is under way.
    struct call {
        notice what;
        steady::time_point begun = steady::now();
        bool blocks = false; // another thread has taken over
    };

    explicit inside(std::chrono::milliseconds most_patience) : patience(most_patience) {}

    // The more calls block, the sooner the next one counts as blocking: together they delay the others by no more than
    // some tens of milliseconds.
    [[nodiscard]] steady::time_point due() const {
        return current->begun + std::max(patience / (1U << std::min<std::size_t>(blocked, 16)), least_patience);
    }

    // With the lock. A thread to make calls, or to take over from the one that does.
    void add_thread() {
        if (ended || working >= most_threads) {
            return;
        }
        try {
            if (threads.count() <= working) {
                threads.add();
            }
        } catch (const std::system_error&) { // those that are there have to do
            return;
        }
        ++working;
        boost::asio::post(threads.get_executor(), [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->work();
            }
        });
    }
    // With the lock: whether somebody waits for the call that is under way.
    [[nodiscard]] bool is_awaited() const { return !waiting.empty() || (ending && current != nullptr); }
    // With the lock: one makes the calls, and one waits whether it is blocked.
    void see_to_threads() {
        const std::size_t wanted = blocked + (is_awaited() ? 1 : 0) + (current == nullptr ? 0 : 1);
        while (working < wanted) {
            const auto before = working;
            add_thread();
            if (working == before) {
                return;
            }
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
                take_over(lock);
            }
        }
        --working;
    }

    void make_call(std::unique_lock<std::mutex>& lock) {
        const auto mine = std::make_shared<call>(call{.what = std::move(waiting.front())});
        waiting.pop_front();
        current = mine;
        ++calls;
        see_to_threads();
        lock.unlock();
        try {
            mine->what.callback();
        } catch (...) {
            log(*mine, log_level::warning, "a job threw when it was told to stop");
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

    void take_over(std::unique_lock<std::mutex>& lock) {
        const auto slow = std::exchange(current, nullptr);
        slow->blocks = true;
        ++blocked;
        see_to_threads();
        changed.notify_all();
        const auto blocked_threads = blocked;
        const bool last = blocked + 1 >= most_threads && !std::exchange(exhausted, true);
        lock.unlock();
        log(*slow, log_level::warning, "its on_stop callback does not return; another thread notifies the other jobs");
        if (last) {
            log(*slow, log_level::error,
                std::to_string(blocked_threads) + " on_stop callbacks do not return: one more delays all that follow");
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
    std::shared_ptr<call> current; // for which the others wait; null: the next thread may begin the next call
    std::size_t working = 0;       // threads in `work`
    std::size_t calls = 0;         // under way, those that block too
    std::size_t blocked = 0;
    bool exhausted = false; // which has been reported, and is not again before all of them have returned
    bool ending = false;
    bool ended = false;
};

stop_notifier::stop_notifier(std::chrono::milliseconds patience) : inside_(std::make_shared<inside>(patience)) {}

stop_notifier::~stop_notifier() { end(std::chrono::milliseconds{0}); }

bool stop_notifier::notify(notice what) {
    auto& in = *inside_;
    const std::lock_guard lock{in.mutex};
    if (in.ended) {
        return false;
    }
    in.waiting.push_back(std::move(what));
    in.see_to_threads();
    in.changed.notify_all();
    return true;
}

std::size_t stop_notifier::end(std::chrono::milliseconds limit) {
    auto& in = *inside_;
    const auto begun = steady::now();
    const auto end = begun + limit;
    std::deque<notice> never;
    std::size_t busy = 0;
    {
        std::unique_lock lock{in.mutex};
        if (in.ended) {
            return 0;
        }
        in.ending = true;
        in.see_to_threads(); // which find out whether the last call blocks, too
        in.changed.notify_all();
        in.changed.wait_until(lock, end, [&] { return in.waiting.empty() && in.calls == 0; });
        in.changed.wait_until(lock, begun + last_moment, [&] { return in.waiting.empty() && in.calls == in.blocked; });
        never.swap(in.waiting);
        in.ended = true;
        busy = in.calls;
        in.changed.notify_all();
    }
    never.clear();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - steady::now());
    return in.threads.stop(std::max(left, std::chrono::milliseconds{0}), busy);
}

} // namespace cles::runtime
