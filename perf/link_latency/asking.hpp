// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

/// The end that wants the data. Each connects, passes over the first few, and gives so many latencies in microseconds.
/// \throws cles::error, std::system_error, or std::runtime_error where something came changed
namespace cles::perf {

struct pace {
    std::size_t count = 1;
    std::chrono::milliseconds interval{}; ///< from one question to the next; updates come as they are published
};

/// From the request to the values: one after the other.
std::vector<double> time_pulls_by_hand(const std::string& url, pace how);
std::vector<double> time_pulls(const std::string& url, pace how);

/// One way, from the publication to the values.
std::vector<double> time_updates_by_hand(const std::string& url, pace how);
std::vector<double> time_updates(const std::string& url, pace how);
/// Those of the car that is heard by multicast at that interface; what the link loses is passed over.
std::vector<double> time_updates_by_multicast(const std::string& interface, pace how);

} // namespace cles::perf
