// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

/// The two ends of an exchange, which may be on different hosts.
namespace cles::perf {

// The server has the data, and runs until it is killed.

/// Called with the URL once the server listens.
using announcement = std::function<void(std::string_view)>;

// One that answers requests does nothing else, by the library and by hand: if it also published, its core would be
// awake when a request arrives.

/// By the library: a node "car1" that answers PULL of "localization".
void serve_replies(std::string_view url, const announcement& announce);
/// By hand: answers each request.
void serve_replies_by_hand(std::string_view url, const announcement& announce);
/// By the library: a node "car1" that publishes "localization" at each interval.
/// \param group where to take part in multicast, as `parse_multicast` reads it
void serve_updates(std::string_view url, std::string_view group, std::chrono::milliseconds interval,
                   const announcement& announce);
/// By hand: sends the packet of a reply at each interval, to one client after the other.
void serve_updates_by_hand(std::string_view url, std::chrono::milliseconds interval, const announcement& announce);

// The client wants the data. Each function connects, ignores the first few results, and returns latencies in
// microseconds. They throw cles::error, std::system_error, or std::runtime_error if a value was changed on the way.

struct pace {
    std::size_t count = 1;
    std::chrono::milliseconds interval{}; ///< between requests; updates arrive as they are published
};

/// From the request to the values, one request after the other.
std::vector<double> time_pulls_by_hand(const std::string& url, pace how);
std::vector<double> time_pulls(const std::string& url, pace how);

/// One way, from the publication to the values.
std::vector<double> time_updates_by_hand(const std::string& url, pace how);
std::vector<double> time_updates(const std::string& url, pace how);
/// From the node that is found in that group. Lost updates are ignored.
std::vector<double> time_updates_by_multicast(const std::string& group, pace how);

} // namespace cles::perf
