// SPDX-License-Identifier: BSL-1.0
#include "output/terminal.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <system_error>

#include <poll.h>
#include <unistd.h>

namespace tool {
namespace {

bool is_set(const char* variable) {
    const char* value = std::getenv(variable);
    return value != nullptr && *value != '\0';
}

std::string styled(stream s, std::string_view style, std::string_view text) {
    if (!has_colours(s)) {
        return std::string{text};
    }
    return std::string{"\x1b["}.append(style).append("m").append(text).append("\x1b[0m");
}

// C1 and characters that change the direction of writing, which the caller may have forgotten to make printable. C0
// stays: its own text contains lines and colours.
std::string without_foreign_controls(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const auto* const control =
            std::ranges::find_if(text, [](char c) { return static_cast<unsigned char>(c) < 0x20; });
        const auto run = static_cast<std::size_t>(control - text.begin());
        out += printable(text.substr(0, run));
        out += text.substr(run, 1);
        text.remove_prefix(std::min(run + 1, text.size()));
    }
    return out;
}

void write_all(std::string_view text) {
    while (!text.empty()) {
        const auto written = ::write(STDOUT_FILENO, text.data(), text.size());
        if (written >= 0) {
            text.remove_prefix(static_cast<std::size_t>(written));
        } else if (errno == EAGAIN) { // another process that shares the pipe made it non-blocking
            pollfd out{STDOUT_FILENO, POLLOUT, 0};
            ::poll(&out, 1, -1);
        } else if (errno == EPIPE) {
            throw output_closed{};
        } else if (errno == EINTR) {
            throw output_interrupted{};
        } else {
            throw std::runtime_error("cannot write the output: " + std::generic_category().message(errno));
        }
    }
}

} // namespace

bool is_terminal(stream s) { return ::isatty(static_cast<int>(s)) == 1; }

bool has_colours(stream s) {
    if (is_set("NO_COLOR") || !is_terminal(s)) {
        return false;
    }
    const char* term = std::getenv("TERM");
    return term != nullptr && std::string_view{term} != "dumb";
}

std::string bold(stream s, std::string_view text) { return styled(s, "1", text); }

std::string red(stream s, std::string_view text) { return styled(s, "31", text); }

std::size_t width_of(std::string_view text) {
    std::size_t width = 0;
    for (const char c : text) {
        width += (static_cast<unsigned char>(c) & 0xc0U) != 0x80 ? 1 : 0;
    }
    return width;
}

std::string padded(std::string text, std::size_t width, bool align_right) {
    const auto used = width_of(text);
    if (used < width) {
        text.insert(align_right ? 0 : text.size(), width - used, ' ');
    }
    return text;
}

void write_output(std::string_view text) { write_all(without_foreign_controls(text)); }

void write_stderr(std::string_view text) {
    const auto shown = without_foreign_controls(text);
    std::fwrite(shown.data(), 1, shown.size(), stderr);
}

void write_within(stream s, std::string_view text, std::chrono::milliseconds limit) noexcept {
    constexpr std::size_t most = 512; // a pipe that is ready takes so much without waiting
    const int descriptor = static_cast<int>(s);
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!text.empty()) {
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
        pollfd out{descriptor, POLLOUT, 0};
        const auto ready = ::poll(&out, 1, static_cast<int>(std::max<std::chrono::milliseconds::rep>(left.count(), 0)));
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        const auto written = ready == 1 ? ::write(descriptor, text.data(), std::min(text.size(), most)) : -1;
        if (written >= 0) {
            text.remove_prefix(static_cast<std::size_t>(written));
        } else if (ready != 1 || (errno != EINTR && errno != EAGAIN)) {
            return;
        }
    }
}

bool is_output_closed() {
    pollfd out{STDOUT_FILENO, 0, 0};
    return ::poll(&out, 1, 0) == 1 && (out.revents & (POLLERR | POLLHUP)) != 0;
}

} // namespace tool
