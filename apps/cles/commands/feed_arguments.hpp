// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/feed.hpp>

#include "options/addresses.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace tool {

class client;

/// The arguments of the commands that bind: to what, where, and for how long.
struct feed_arguments {
    address_book addresses{};
    std::string noun{};
    std::optional<std::chrono::milliseconds> timeout{};
    std::chrono::milliseconds every{0};
    std::chrono::milliseconds duration{0};
    std::uint32_t keep = 0;
    std::uint32_t hops = 8;
    std::uint64_t count = 0;

    void add_options(CLI::App& command, const std::string& count_help);
    /// \throws usage_error if the options exclude each other
    void check() const;
    /// Whether updates come by multicast: for `all:` without an address, and with --multicast.
    [[nodiscard]] bool is_multicast() const;
    [[nodiscard]] cles::bind_options options(const client& requester) const;
    /// Explains failures, and ends after the duration, if one was given.
    void prepare(client& requester) const;
};

/// Reports an event of a feed on stderr: updates missed, its publisher lost or found again.
void note_event(const std::string& noun, const cles::feed_item<cles::json_text>& item);

} // namespace tool
