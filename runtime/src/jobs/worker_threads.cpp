// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_threads.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace cles::runtime {

namespace {

constexpr std::chrono::seconds most_to_wake{1};

} // namespace

struct worker_threads::inside {
    struct worker {
        std::thread thread;
        bool ended = false;
    };

    boost::asio::thread_pool pool{0};
    std::mutex mutex;
    std::condition_variable one_ended;
    std::vector<std::unique_ptr<worker>> workers;
    std::size_t running = 0;
};

worker_threads::worker_threads(std::size_t count) : inside_(std::make_shared<inside>()) {
    try {
        for (std::size_t i = 0; i < count; ++i) {
            add();
        }
    } catch (...) {
        stop(std::chrono::milliseconds::max());
        throw;
    }
}

worker_threads::~worker_threads() { stop(std::chrono::milliseconds{0}, count()); }

void worker_threads::add() {
    const std::lock_guard lock{inside_->mutex};
    auto made = std::make_unique<inside::worker>();
    made->thread = std::thread{[self = inside_, mine = made.get()] {
        self->pool.attach();
        const std::lock_guard ending{self->mutex};
        mine->ended = true;
        --self->running;
        self->one_ended.notify_all();
    }};
    inside_->workers.push_back(std::move(made));
    ++inside_->running;
}

std::size_t worker_threads::count() const noexcept {
    const std::lock_guard lock{inside_->mutex};
    return inside_->workers.size();
}

boost::asio::thread_pool::executor_type worker_threads::get_executor() const noexcept {
    return inside_->pool.get_executor();
}

std::size_t worker_threads::stop(std::chrono::milliseconds limit, std::size_t busy) {
    inside_->pool.stop();
    std::unique_lock lock{inside_->mutex};
    const auto all_ended = [this] { return inside_->running == 0; };
    if (limit == std::chrono::milliseconds::max()) {
        inside_->one_ended.wait(lock, all_ended);
    } else {
        inside_->one_ended.wait_for(lock, limit, all_ended);
        // Those that run nothing take a moment too.
        inside_->one_ended.wait_for(lock, most_to_wake, [&] { return inside_->running <= busy; });
    }
    // A thread that goes on finds its mark as long as it lives: it holds what the list is in.
    std::vector<std::thread> ended;
    std::size_t left = 0;
    for (const auto& w : inside_->workers) {
        if (!w->thread.joinable()) {
            continue;
        }
        if (w->ended) {
            ended.push_back(std::move(w->thread));
        } else {
            w->thread.detach();
            ++left;
        }
    }
    lock.unlock();
    for (auto& t : ended) {
        t.join();
    }
    return left;
}

} // namespace cles::runtime
