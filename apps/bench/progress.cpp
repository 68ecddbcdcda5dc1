// SPDX-License-Identifier: BSL-1.0
#include "progress.hpp"

#include "output/terminal.hpp"

#include <cstdio>
#include <string>

namespace tool {
namespace {

constexpr std::size_t bar_width = 30;
constexpr const char* erase_line = "\r\x1b[K";

} // namespace

bench_progress::bench_progress(std::size_t steps) : steps_(steps), shown_(is_terminal(stream::err)) {}

bench_progress::~bench_progress() {
    if (shown_) {
        std::fputs(erase_line, stderr);
    }
}

void bench_progress::step(std::string_view what) {
    if (!shown_) {
        return;
    }
    const std::size_t filled = steps_ == 0 ? bar_width : bar_width * done_ / steps_;
    std::string line{erase_line};
    line.append("[").append(filled, '#').append(bar_width - filled, '.').append("] ");
    line.append(std::to_string(++done_)).append("/").append(std::to_string(steps_)).append(" ").append(what);
    std::fputs(line.c_str(), stderr);
    std::fflush(stderr);
}

} // namespace tool
