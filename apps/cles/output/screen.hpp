// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace tool {

/// The whole terminal, for output that changes in place; the destructor restores what was shown before.
class screen {
  public:
    /// Whether stdout is a terminal that supports this.
    static bool is_supported();

    /// \param on_quit is called for 'q', on the context
    screen(boost::asio::io_context& io, std::function<void()> on_quit);
    screen(const screen&) = delete;
    screen& operator=(const screen&) = delete;
    ~screen();

    /// Shows these lines, as far as they fit.
    void show(std::string_view text);

  private:
    class key_reader;

    std::unique_ptr<key_reader> keys_; // null if stdin is not a terminal
};

/// The first `columns` columns of a line; escape sequences do not count.
std::string cut_to_width(std::string_view line, std::size_t columns);

} // namespace tool
