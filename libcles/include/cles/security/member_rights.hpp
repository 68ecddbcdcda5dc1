// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// What a member of a fleet is permitted, as its entry in the roster lists it (docs/protocol_security.md, "Rights").
struct member_rights {
    std::optional<std::vector<std::string>> may{};    ///< what it may request; none: everything
    std::optional<std::vector<std::string>> offers{}; ///< what others may request of it; none: everything
    std::vector<std::string> forwards{};              ///< patterns of the names for which it may forward
};

/// What is wrong with a right, such as "pull,bind *:localization"; empty if it is valid.
std::string flaw_of_right(std::string_view text);
/// What is wrong with the pattern of a name, such as "sat*"; empty if it is valid.
std::string flaw_of_name_pattern(std::string_view text);

} // namespace cles::security
