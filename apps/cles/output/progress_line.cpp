// SPDX-License-Identifier: BSL-1.0
#include "output/progress_line.hpp"

#include "output/errors.hpp"
#include "output/terminal.hpp"

#include <cmath>
#include <string>

namespace tool {
namespace {

constexpr int bar_width = 30;

} // namespace

progress_line::progress_line(bool always) : is_terminal_(is_terminal(stream::err)), always_(always) {}

void progress_line::show(double fraction, std::string_view details) {
    const auto percent = std::to_string(std::lround(fraction * 100)) + "%";
    const std::string more = details == "{}" ? std::string{} : " " + std::string{details};
    if (!is_terminal_) {
        note("progress " + percent + more);
        return;
    }
    const auto filled = static_cast<std::size_t>(std::lround(fraction * bar_width));
    std::string bar(filled, '#');
    bar.resize(bar_width, '.');
    write_stderr("\r\x1b[K[" + bar + "] " + percent + printable(std::string_view{more}.substr(0, 60)));
    drawn_ = true;
}

void progress_line::clear() {
    if (drawn_) {
        write_stderr("\r\x1b[K");
        drawn_ = false;
    }
}

} // namespace tool
