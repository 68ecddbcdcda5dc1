// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "support/run_until.hpp"

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>

#include <future>
#include <stdexcept>
#include <thread>
#include <type_traits>
#include <utility>

namespace cles::test {

/// An io_context with a thread that runs it.
class side_thread {
  public:
    side_thread() : thread_([this] { io_.run(); }) {}
    side_thread(const side_thread&) = delete;
    side_thread& operator=(const side_thread&) = delete;
    ~side_thread() {
        busy_.reset();
        io_.stop();
        thread_.join();
    }

    [[nodiscard]] boost::asio::io_context& io() noexcept { return io_; }

    /// Runs `f` there and waits for its result; inline if called there.
    template <class F>
    std::invoke_result_t<F&> run(F f) {
        if (io_.get_executor().running_in_this_thread()) {
            return f();
        }
        std::packaged_task<std::invoke_result_t<F&>()> task{std::move(f)};
        auto result = task.get_future();
        boost::asio::post(io_, [task = std::move(task)]() mutable { task(); });
        if (result.wait_for(patience) != std::future_status::ready) {
            throw std::runtime_error{"the other thread does not answer"};
        }
        return result.get();
    }

  private:
    boost::asio::io_context io_;
    boost::asio::executor_work_guard<boost::asio::io_context::executor_type> busy_{io_.get_executor()};
    std::thread thread_;
};

} // namespace cles::test
