// SPDX-License-Identifier: BSL-1.0
#include "protocol/parts.hpp"

#include "protocol/grammar.hpp"

#include <array>
#include <charconv>

namespace cles::protocol {

bool split_adverb(std::string_view part, adverb& out) noexcept {
    const auto equals = part.find('=');
    if (equals == 0 || equals == std::string_view::npos || equals + 1 == part.size()) {
        return false;
    }
    out = {part.substr(0, equals), part.substr(equals + 1)};
    for (const auto c : out.key) {
        if (!((c >= 'a' && c <= 'z') || c == '_')) {
            return false;
        }
    }
    for (const auto c : out.value) {
        if (c <= 0x20 || c >= 0x7F) {
            return false;
        }
    }
    return true;
}

std::optional<std::uint64_t> number_between(std::string_view text, std::uint64_t low, std::uint64_t high) noexcept {
    const auto value = parse_number(text);
    return value && *value >= low && *value <= high ? value : std::nullopt;
}

void append_number(std::string& out, std::uint64_t n) {
    std::array<char, 20> digits;
    const auto* const end = std::to_chars(digits.data(), digits.data() + digits.size(), n).ptr;
    out.append(digits.data(), static_cast<std::size_t>(end - digits.data()));
}

} // namespace cles::protocol
