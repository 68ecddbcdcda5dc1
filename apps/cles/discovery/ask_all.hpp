// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace tool {

class client;

struct node_answer {
    std::string json;  ///< empty where it failed
    std::string error; ///< why
};

/// PULLs a noun from each URL, all at once, and gives the answers in the order of the URLs. An empty URL stands for a
/// node that has no address of use here. Throws only when it is interrupted.
boost::asio::awaitable<std::vector<node_answer>> ask_all(client& asker, std::string noun, std::vector<std::string> urls,
                                                         std::chrono::milliseconds limit);

} // namespace tool
