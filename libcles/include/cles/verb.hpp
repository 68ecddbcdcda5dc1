// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace cles {

/// The five verbs of the language (paper, Table 1).
enum class verb : std::uint8_t { pull, push, delegate, bind, update };

inline constexpr std::size_t verb_count = 5;
inline constexpr std::array<std::string_view, verb_count> verb_names{"PULL", "PUSH", "DELEGATE", "BIND", "UPDATE"};

/// The verb's name in capitals, as sent on the wire.
constexpr std::string_view to_string(verb v) noexcept { return verb_names[static_cast<std::size_t>(v)]; }

/// The verb with this name, case-insensitively; empty if there is none.
std::optional<verb> verb_from(std::string_view text) noexcept;

} // namespace cles
