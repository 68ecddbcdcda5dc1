// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <functional>
#include <string_view>

/// The end that has the data, for ever.
namespace cles::perf {

/// Told where it listens, once it does.
using announcement = std::function<void(std::string_view)>;

/// By the library: a node "car1" that answers PULL of "localization", and publishes it as time passes.
/// \param interface by which it takes part in multicast; empty: it does not
void serve_car(std::string_view url, std::string_view interface, std::chrono::milliseconds interval,
               const announcement& announce);
/// By hand: answers each request.
void serve_replies_by_hand(std::string_view url, const announcement& announce);
/// By hand: the packet of a reply, sent unasked as time passes, to one client after the other.
void serve_updates_by_hand(std::string_view url, std::chrono::milliseconds interval, const announcement& announce);

} // namespace cles::perf
