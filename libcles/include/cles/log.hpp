// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <string_view>

namespace cles {

enum class log_level : std::uint8_t { debug, info, warning, error };

/// A log message and what it is about. Converts from and to text; all views are valid during the call.
struct log_entry {
    template <std::convertible_to<std::string_view> Text>
    log_entry(const Text& words) noexcept : text(words) {} // NOLINT(google-explicit-constructor): any text is an entry
    log_entry(std::string_view words, std::string_view whom, std::uint64_t id = 0, std::string_view of = {}) noexcept
        : text(words), peer(whom), request(id), trace(of) {}

    std::string_view text;
    std::string_view peer{};   ///< `identity::address` of the peer; empty if no peer is concerned
    std::uint64_t request = 0; ///< the id of the request on its link; 0: no request, or one without id
    std::string_view trace{};  ///< the id of the trace that the request belongs to; empty if there is none

    operator std::string_view() const noexcept { return text; } // NOLINT(google-explicit-constructor): as above
};

/// The log of a service. Called on the service's executor; it must neither throw nor block. The library links no
/// logging framework, so a program passes a function that writes to its own framework. If the function does not need
/// the peer, its second parameter may be a `std::string_view`.
using log_sink = std::function<void(log_level, const log_entry&)>;

} // namespace cles
