// SPDX-License-Identifier: BSL-1.0
#include "output/screen.hpp"

#include "output/terminal.hpp"

#include <boost/asio/buffer.hpp>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

namespace tool {

namespace asio = boost::asio;

namespace {

// ECMA-48, and xterm's alternate screen.
constexpr std::string_view enter = "\x1b[?1049h\x1b[?25l";
constexpr std::string_view leave = "\x1b[?25h\x1b[?1049l";
constexpr std::string_view to_top = "\x1b[H";
constexpr std::string_view end_of_line = "\x1b[K";
constexpr std::string_view clear_below = "\x1b[J";

winsize size_of_terminal() {
    winsize size{};
    if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_row == 0 || size.ws_col == 0) {
        size.ws_row = 24;
        size.ws_col = 80;
    }
    return size;
}

} // namespace

/// Reads each key at once, without echo.
class screen::key_reader {
  public:
    key_reader(asio::io_context& io, const termios& before, std::function<void()> on_quit)
        : before_(before), input_(io, ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)), on_quit_(std::move(on_quit)) {
        auto quiet = before;
        quiet.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
        // Linux sends the signal of ^C and then decides whether to echo it. Unless it flushes in between, the terminal
        // cannot be restored before that.
        quiet.c_lflag |= NOFLSH;
        ::tcsetattr(STDIN_FILENO, TCSANOW, &quiet);
        read_key();
    }
    key_reader(const key_reader&) = delete;
    key_reader& operator=(const key_reader&) = delete;
    ~key_reader() { ::tcsetattr(STDIN_FILENO, TCSANOW, &before_); }

  private:
    void read_key() {
        input_.async_read_some(asio::buffer(typed_), [this](boost::system::error_code code, std::size_t size) {
            if (code) { // this may be destroyed
                return;
            }
            if (std::string_view{typed_.data(), size}.find('q') != std::string_view::npos) {
                on_quit_();
            } else {
                read_key();
            }
        });
    }

    const termios before_;
    asio::posix::stream_descriptor input_;
    std::function<void()> on_quit_;
    std::array<char, 64> typed_{};
};

bool screen::is_supported() {
    const char* term = std::getenv("TERM");
    return is_terminal(stream::out) && term != nullptr && *term != '\0' && std::string_view{term} != "dumb";
}

screen::screen(asio::io_context& io, std::function<void()> on_quit) {
    if (termios now{}; ::tcgetattr(STDIN_FILENO, &now) == 0) {
        keys_ = std::make_unique<key_reader>(io, now, std::move(on_quit));
    }
    write_output(enter);
}

screen::~screen() {
    try {
        write_output(leave);
    } catch (...) { // the output is closed
        return;
    }
}

void screen::show(std::string_view text) {
    const auto size = size_of_terminal();
    std::string out{to_top};
    for (std::size_t row = 0; row < size.ws_row && !text.empty(); ++row) {
        const auto end = std::min(text.find('\n'), text.size());
        out.append(row == 0 ? "" : "\r\n").append(cut_to_width(text.substr(0, end), size.ws_col)).append(end_of_line);
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    write_output(out.append(clear_below));
}

std::string cut_to_width(std::string_view line, std::size_t columns) {
    std::string out;
    std::size_t used = 0;
    while (!line.empty()) {
        std::size_t length = 1;
        if (line.front() == '\x1b') {
            length = std::min(line.find('m'), line.size() - 1) + 1;
        } else {
            while (length < line.size() && (static_cast<unsigned char>(line[length]) & 0xc0U) == 0x80) {
                ++length; // the rest of a character
            }
            if (++used > columns) {
                line.remove_prefix(length);
                continue; // escape sequences behind it still apply
            }
        }
        out.append(line.substr(0, length));
        line.remove_prefix(length);
    }
    return out;
}

} // namespace tool
