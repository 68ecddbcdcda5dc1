// SPDX-License-Identifier: BSL-1.0
#include "relay_thread.hpp"

#include <array>
#include <utility>

#include <fcntl.h>

namespace cles::perf {

relay_thread::relay_thread(std::function<void(int stop)> work) {
    std::array<int, 2> ends{};
    checked(::pipe2(ends.data(), O_CLOEXEC), "pipe");
    stop_here_ = descriptor{ends[0]};
    stop_ = descriptor{ends[1]};
    thread_ = std::thread{std::move(work), stop_here_.get()};
}

relay_thread::~relay_thread() {
    stop_.reset();
    thread_.join();
}

} // namespace cles::perf
