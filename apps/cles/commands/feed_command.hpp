// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>

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

/// What commands have in common that bind: to what, where, and for how long.
struct feed_command {
    address_book addresses{};
    std::string noun{};
    std::optional<std::chrono::milliseconds> timeout{};
    std::chrono::milliseconds every{0};
    std::chrono::milliseconds duration{0};
    std::uint32_t keep = 0;
    std::uint64_t count = 0;

    void add_options(CLI::App& command, const std::string& count_help);
    /// Whether the group is bound, and no link: `all:` where no address was given, and what --multicast asks for.
    [[nodiscard]] bool is_multicast() const;
    /// \throws usage_error where the options do not go together
    void check() const;
    [[nodiscard]] cles::bind_options options(const client& asker) const;
    /// Has the client end when the duration is over, if one was given.
    void arm(client& asker) const;
};

} // namespace tool
