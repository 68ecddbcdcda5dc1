// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/completion_queue.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <cstddef>
#include <deque>
#include <memory>

namespace cles::shell {

/// Calls completions on an executor, in order and never from inside `put`. Those that wait are called in one function
/// of the executor, and so are those that they put, up to `most_at_once` in all: what several of them publish or ask
/// for is then written together.
///
/// While any waits, a further function is always posted. So an exception from one leaves the executor's `run` and the
/// others are called all the same, and one that runs the executor itself gets the others called.
class completion_drain : public std::enable_shared_from_this<completion_drain> {
  public:
    static constexpr std::size_t most_at_once = 8;

    explicit completion_drain(boost::asio::any_io_executor executor) : executor_(std::move(executor)) {}

    void put(core::completion due);

  private:
    class posted;

    void post();
    void run();

    boost::asio::any_io_executor executor_;
    std::deque<core::completion> due_;
    bool is_posted_ = false;
};

} // namespace cles::shell
