// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "completion/candidates.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace tool {

class address_book;
class client;

// Candidates from the nodes on the network. What is not known by the time `until` is left out. They only throw when
// they are cancelled.

/// The names of nodes, "car1".
boost::asio::awaitable<std::vector<candidate>> live_names(client& requester, const address_book& addresses,
                                                          std::chrono::steady_clock::time_point until);

/// The URLs of nodes.
boost::asio::awaitable<std::vector<candidate>> live_urls(client& requester, const address_book& addresses,
                                                         std::chrono::steady_clock::time_point until);

/// The nouns of that node for that verb, "car1:localization", "car1:echo/". For `any` and `all` those of every node.
boost::asio::awaitable<std::vector<candidate>> live_nouns(client& requester, const address_book& addresses,
                                                          std::string node, cles::verb verb,
                                                          std::chrono::steady_clock::time_point until);

/// An example of the body that the node takes for that noun and verb.
boost::asio::awaitable<std::vector<candidate>> live_bodies(client& requester, std::string noun, cles::verb verb,
                                                           std::chrono::steady_clock::time_point until);

} // namespace tool
