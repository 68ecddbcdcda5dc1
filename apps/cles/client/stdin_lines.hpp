// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace tool {

/// The lines of stdin, each read when it is wanted, so that their writer waits for this program.
class stdin_lines {
  public:
    /// Bytes of a line.
    static constexpr std::size_t longest = 16U << 20U;

    /// \throws std::runtime_error if stdin is closed
    explicit stdin_lines(boost::asio::io_context& io);
    stdin_lines(const stdin_lines&) = delete;
    stdin_lines& operator=(const stdin_lines&) = delete;
    /// Leaves stdin as it was to others who have it open.
    ~stdin_lines();

    /// The next line that is not blank, without its end; nothing at the end of stdin. The last one need not end in LF.
    /// \throws std::runtime_error if a line is too long, or stdin cannot be read; and when it is cancelled
    boost::asio::awaitable<std::optional<std::string>> next();
    /// The number of the line that was returned last, from 1.
    [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
    /// Ends a `next` that waits.
    void cancel();

  private:
    std::optional<std::string> take_line();

    int flags_; // of the open file, which others may share
    boost::asio::posix::stream_descriptor input_;
    std::array<char, 65536> chunk_{};
    std::string text_; // that has been read
    std::size_t searched_ = 0;
    std::uint64_t number_ = 0;
    bool has_ended_ = false;
};

} // namespace tool
