// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <string_view>

namespace cles {

enum class log_level : std::uint8_t { debug, info, warning, error };

/// What is told, and of whom. Stands for its text wherever text is wanted; all views are valid for the call.
struct log_entry {
    template <std::convertible_to<std::string_view> Text>
    log_entry(const Text& words) noexcept : text(words) {} // NOLINT(google-explicit-constructor): a text is one
    log_entry(std::string_view words, std::string_view whom, std::uint64_t id = 0) noexcept
        : text(words), peer(whom), request(id) {}

    std::string_view text;
    std::string_view peer{};   ///< `identity::address` of who is at the other end; empty where it is nobody's doing
    std::uint64_t request = 0; ///< the id of the request on its link; 0: none, or one without

    operator std::string_view() const noexcept { return text; } // NOLINT(google-explicit-constructor): as above
};

/// Where a service tells what happens to it. Called on the service's executor; it must neither throw nor block. The
/// library links no logging framework: a program hands its own in, which may take a `std::string_view` for the entry
/// where it does not care whom it is about.
using log_sink = std::function<void(log_level, const log_entry&)>;

} // namespace cles
