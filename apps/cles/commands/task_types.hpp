// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "output/printer.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <optional>
#include <string>

namespace tool {

class address_book;
class client;

/// `cles info NODE:TASK`: what the node tells about the types of the task. What it refers to must outlive it.
boost::asio::awaitable<void> show_task(client& requester, const address_book& addresses, const std::string& noun,
                                       const std::optional<std::chrono::milliseconds>& timeout, output_format format);

} // namespace tool
