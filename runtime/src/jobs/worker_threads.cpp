// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_threads.hpp"

#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace cles::runtime {
namespace {

constexpr std::chrono::seconds idle_stop_limit{1};

} // namespace

struct worker_threads::state {
    boost::asio::thread_pool pool{0};
    std::mutex mutex;
    std::condition_variable one_ended;
    std::vector<std::thread> threads;
    std::size_t running = 0;
};

worker_threads::worker_threads(std::size_t count) : state_(std::make_shared<state>()) {
    try {
        for (std::size_t i = 0; i < count; ++i) {
            add();
        }
    } catch (...) {
        stop(std::chrono::milliseconds{0});
        throw;
    }
}

worker_threads::~worker_threads() { stop(std::chrono::milliseconds{0}, count()); }

void worker_threads::add() {
    const std::lock_guard lock{state_->mutex};
    try {
        state_->threads.emplace_back([self = state_] {
            self->pool.attach();
            const std::lock_guard ending{self->mutex};
            --self->running;
            self->one_ended.notify_all();
        });
    } catch (const std::system_error& e) {
        throw std::system_error(e.code(), "the system refuses a thread");
    }
    ++state_->running;
}

std::size_t worker_threads::count() const noexcept {
    const std::lock_guard lock{state_->mutex};
    return state_->threads.size();
}

boost::asio::thread_pool::executor_type worker_threads::get_executor() const noexcept {
    return state_->pool.get_executor();
}

std::size_t worker_threads::stop(std::chrono::milliseconds limit, std::size_t busy) {
    state_->pool.stop();
    std::unique_lock lock{state_->mutex};
    auto threads = std::exchange(state_->threads, {});
    if (threads.empty()) {
        return 0;
    }
    const auto all_ended = [this] { return state_->running == 0; };
    state_->one_ended.wait_for(lock, limit, all_ended);
    // Idle threads take a moment too.
    state_->one_ended.wait_for(lock, idle_stop_limit, [&] { return state_->running <= busy; });
    const auto left = state_->running;
    lock.unlock();
    for (auto& thread : threads) {
        left == 0 ? thread.join() : thread.detach(); // an abandoned thread shares the state
    }
    return left;
}

} // namespace cles::runtime
