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

/// The whole terminal, for something that changes in place; what was there before is back when it is destroyed.
class screen {
  public:
    /// Whether stdout is a terminal that can be written in place.
    static bool is_there();

    /// \param on_quit is called for 'q', on the context
    screen(boost::asio::io_context& io, std::function<void()> on_quit);
    screen(const screen&) = delete;
    screen& operator=(const screen&) = delete;
    ~screen();

    /// Shows these lines, as far as they have room.
    void show(std::string_view text);

  private:
    class keys;

    std::unique_ptr<keys> keys_; // null where stdin is no terminal
};

/// The first so many columns of a line, escape sequences not counted.
std::string cut_to_width(std::string_view line, std::size_t columns);

} // namespace tool
