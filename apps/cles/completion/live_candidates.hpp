// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "completion/candidate.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace tool {

class address_book;
class client;

// What can be asked of the network now, found out within a time that somebody who types does not notice. What cannot
// be had by then is left out; nothing is thrown but for an interruption.

/// The names of nodes, "car1".
boost::asio::awaitable<std::vector<candidate>> live_names(client& asker, const address_book& addresses,
                                                          std::chrono::steady_clock::time_point until);

/// The URLs of nodes.
boost::asio::awaitable<std::vector<candidate>> live_urls(client& asker, const address_book& addresses,
                                                         std::chrono::steady_clock::time_point until);

/// The nouns of that node for that verb, "car1:localization", "car1:echo/". Of `any` and `all` those of every node.
boost::asio::awaitable<std::vector<candidate>> live_nouns(client& asker, const address_book& addresses,
                                                          std::string node, cles::verb verb,
                                                          std::chrono::steady_clock::time_point until);

} // namespace tool
