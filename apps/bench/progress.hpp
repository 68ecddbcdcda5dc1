// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string_view>

namespace tool {

/// A progress bar on stderr if that is a terminal. It changes only between passes, so that it does not disturb them.
class bench_progress {
  public:
    explicit bench_progress(std::size_t steps);
    bench_progress(const bench_progress&) = delete;
    bench_progress& operator=(const bench_progress&) = delete;
    ~bench_progress();

    /// The next step begins.
    void step(std::string_view what);

  private:
    std::size_t steps_;
    std::size_t done_ = 0;
    bool shown_;
};

} // namespace tool
