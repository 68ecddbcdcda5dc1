// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/convert.hpp>

#include <boost/asio/awaitable.hpp>

#include <string>
#include <vector>

namespace tool {

class client;

/// Sends a request to the first of these nodes that routes, if one has to be found: the others refuse it before they
/// begin. Afterwards, `options` contain the address of the one that has answered, and `routers` is empty.
boost::asio::awaitable<cles::json_text> send_routed(client& requester, const std::string& command,
                                                    cles::call_options& options, std::vector<std::string>& routers);

} // namespace tool
