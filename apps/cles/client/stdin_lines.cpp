// SPDX-License-Identifier: BSL-1.0
#include "client/stdin_lines.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

namespace tool {

namespace asio = boost::asio;

namespace {

int copy_of_stdin() {
    const int copy = ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    if (copy < 0) {
        throw std::runtime_error("cannot read stdin: " + std::generic_category().message(errno));
    }
    return copy;
}

} // namespace

stdin_lines::stdin_lines(asio::io_context& io) : flags_(::fcntl(STDIN_FILENO, F_GETFL)), input_(io, copy_of_stdin()) {}

stdin_lines::~stdin_lines() {
    if (flags_ >= 0) {
        ::fcntl(STDIN_FILENO, F_SETFL, flags_); // without O_NONBLOCK, which reading has set
    }
}

asio::awaitable<std::optional<std::string>> stdin_lines::next() {
    for (;;) {
        auto line = take_line();
        if (line) {
            co_return line;
        }
        if (has_ended_) {
            co_return std::nullopt;
        }
        if (text_.size() > longest) {
            throw std::runtime_error("line " + std::to_string(number_ + 1) + " of stdin is longer than " +
                                     std::to_string(longest) + " bytes");
        }
        boost::system::error_code code;
        const auto size =
            co_await input_.async_read_some(asio::buffer(chunk_), asio::redirect_error(asio::use_awaitable, code));
        text_.append(chunk_.data(), size);
        if (code == asio::error::eof) {
            has_ended_ = true;
        } else if (code == asio::error::operation_aborted) {
            throw boost::system::system_error(code);
        } else if (code) {
            throw std::runtime_error("cannot read stdin: " + code.message());
        }
    }
}

// The next one that is complete, or the rest at the end; blank ones are only counted.
std::optional<std::string> stdin_lines::take_line() {
    for (;;) {
        const auto end = text_.find('\n', searched_);
        if (end == std::string::npos && (!has_ended_ || text_.empty())) {
            searched_ = text_.size();
            return std::nullopt;
        }
        auto line = text_.substr(0, end);
        text_.erase(0, end == std::string::npos ? end : end + 1);
        searched_ = 0;
        ++number_;
        if (line.find_first_not_of(" \t\r") != std::string::npos) {
            return line;
        }
    }
}

void stdin_lines::cancel() {
    boost::system::error_code ignored;
    input_.cancel(ignored);
}

} // namespace tool
