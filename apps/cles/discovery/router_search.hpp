// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/awaitable.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace tool {

class address_book;
class client;

/// Whether the noun is of `any:` or `all:` and nothing says where to ask: a node that routes has to be found.
bool needs_router(const address_book& addresses, std::string_view noun);

/// URLs of the nodes heard of that may route, the most likely first; waits for one of them while nodes still announce
/// themselves after the start. Where nobody is heard of, the address at which nodes listen unless something else is
/// said.
boost::asio::awaitable<std::vector<std::string>> possible_routers(client& asker);

} // namespace tool
