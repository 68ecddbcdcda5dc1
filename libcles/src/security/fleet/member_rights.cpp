// SPDX-License-Identifier: BSL-1.0
#include <cles/security/member_rights.hpp>

#include "protocol/grammar.hpp"
#include "security/access/rights.hpp"
#include "security/access/wildcard.hpp"

namespace cles::security {

std::string flaw_of_right(std::string_view text) {
    std::string why;
    return right::parse(text, &why) ? std::string{} : why;
}

std::string flaw_of_name_pattern(std::string_view text) {
    if (is_name_pattern(text)) {
        return {};
    }
    return protocol::quoted(text) +
           " is not the pattern of a name (letters, digits, '_', '-', '.', and '*' for any characters)";
}

} // namespace cles::security
