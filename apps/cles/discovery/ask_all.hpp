// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/system/error_code.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace tool {

class client;

struct node_answer {
    std::string json;  ///< empty if it failed
    std::string error; ///< why
    boost::system::error_code code;
};

/// PULLs a noun from each URL, in parallel. The answers are in the order of the URLs. An empty URL stands for a node
/// without a usable address. It only throws when it is cancelled.
boost::asio::awaitable<std::vector<node_answer>>
ask_all(client& requester, std::string noun, std::vector<std::string> urls, std::chrono::milliseconds limit);

} // namespace tool
