// SPDX-License-Identifier: BSL-1.0
#include "output/terminal.hpp"

#include "output/errors.hpp"

#include <array>
#include <cerrno>
#include <cstdint>
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

bool needs_escape(std::uint32_t c) {
    return c < 0x20 || (c >= 0x7f && c <= 0x9f) || (c >= 0x202a && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
}

void append_escape(std::uint32_t c, std::string& out) {
    switch (c) {
    case '\n': out += "\\n"; return;
    case '\t': out += "\\t"; return;
    case '\r': out += "\\r"; return;
    default: break;
    }
    std::array<char, 8> escape{};
    std::snprintf(escape.data(), escape.size(), "\\u%04x", static_cast<unsigned>(c & 0xffffU));
    out += escape.data();
}

// The character that begins the text, and the bytes it takes; 0 bytes where it is not UTF-8.
std::size_t decode(std::string_view text, std::uint32_t& c) {
    const auto first = static_cast<unsigned char>(text.front());
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xc2 && first < 0xe0 ? 2
                               : (first & 0xf0U) == 0xe0       ? 3
                               : first >= 0xf0 && first < 0xf5 ? 4
                                                               : 0;
    if (length == 0 || length > text.size()) {
        return 0;
    }
    c = length == 1 ? first : first & (0x7fU >> length);
    for (std::size_t i = 1; i < length; ++i) {
        const auto next = static_cast<unsigned char>(text[i]);
        if ((next & 0xc0U) != 0x80) {
            return 0;
        }
        c = (c << 6U) | (next & 0x3fU);
    }
    return length;
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

std::string printable(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    while (!text.empty()) {
        std::uint32_t c = 0;
        std::size_t length = decode(text, c);
        if (length == 0) {
            out += "\xef\xbf\xbd"; // U+FFFD
            length = 1;
        } else if (needs_escape(c)) {
            append_escape(c, out);
        } else {
            out += text.substr(0, length);
        }
        text.remove_prefix(length);
    }
    return out;
}

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

void write_output(std::string_view text) {
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

void write_stderr(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stderr); }

bool is_output_closed() {
    pollfd out{STDOUT_FILENO, 0, 0};
    return ::poll(&out, 1, 0) == 1 && (out.revents & (POLLERR | POLLHUP)) != 0;
}

} // namespace tool
