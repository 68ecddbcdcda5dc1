// SPDX-License-Identifier: BSL-1.0
#include "port/group_source.hpp"

#include <charconv>
#include <system_error>

namespace cles::core {
namespace {

/// Parses a number of at most `most`, and `then` after it (the end, if empty).
bool take_number(std::string_view& text, std::uint32_t most, std::string_view then, std::uint32_t& out) noexcept {
    const auto* const end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, out);
    if (code != std::errc{} || out > most) {
        return false;
    }
    text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
    if (then.empty() ? !text.empty() : !text.starts_with(then)) {
        return false;
    }
    text.remove_prefix(then.size());
    return true;
}

} // namespace

std::optional<group_source> parse_group_source(std::string_view text) noexcept {
    group_source read;
    for (const std::string_view then : {".", ".", ".", ":"}) {
        std::uint32_t byte = 0;
        if (!take_number(text, 0xFF, then, byte)) {
            return {};
        }
        read.address = read.address << 8U | byte;
    }
    std::uint32_t port = 0;
    if (!take_number(text, 0xFFFF, "", port) || port == 0) {
        return {};
    }
    read.port = static_cast<std::uint16_t>(port);
    return read;
}

} // namespace cles::core
