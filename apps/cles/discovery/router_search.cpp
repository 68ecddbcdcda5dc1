// SPDX-License-Identifier: BSL-1.0
#include "discovery/router_search.hpp"

#include "client/client.hpp"
#include "options/addresses.hpp"
#include "options/arguments.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr auto search_time = 350ms;       // of asking who is there, and a little
constexpr std::size_t max_candidates = 8; // where so many do not route, none will

// What is announced does not say who routes; daemons do, and have workers.
bool is_likely(const cles::peer& node) { return node.load.workers != 0; }

bool is_usable(const cles::peer& node) { return node.state == cles::peer_state::live && !node.endpoints.empty(); }

} // namespace

bool needs_router(const address_book& addresses, std::string_view noun) {
    const auto node = target_of(noun);
    return (node == "any" || node == "all") && addresses.finds_by_name();
}

asio::awaitable<std::vector<std::string>> possible_routers(client& asker) {
    const auto until = steady::now() + search_time;
    auto known = asker.node().peers();
    while (steady::now() < until && std::none_of(known.begin(), known.end(), [](const cles::peer& node) {
               return is_usable(node) && is_likely(node);
           })) {
        co_await asker.sleep_until(std::min(until, steady::now() + 5ms));
        known = asker.node().peers();
    }
    std::erase_if(known, [](const cles::peer& node) { return !is_usable(node); });
    std::stable_partition(known.begin(), known.end(), is_likely);
    known.resize(std::min(known.size(), max_candidates));

    std::vector<std::string> urls;
    urls.reserve(known.size() + 1);
    for (const auto& node : known) {
        urls.push_back(node.endpoints.front());
    }
    if (urls.empty()) {
        urls.emplace_back(default_url);
    }
    co_return urls;
}

} // namespace tool
