// SPDX-License-Identifier: BSL-1.0
#include "security/access/wildcard.hpp"

#include "protocol/grammar.hpp"

#include <cstddef>
#include <cstring>

namespace cles::security {
namespace {

// Unlike `find`, linear for any text: both may be long, and one comes from a peer.
std::size_t position_of(std::string_view part, std::string_view text) noexcept {
    if (part.empty()) {
        return 0;
    }
    const void* const found = ::memmem(text.data(), text.size(), part.data(), part.size());
    return found == nullptr ? std::string_view::npos
                            : static_cast<std::size_t>(static_cast<const char*>(found) - text.data());
}

} // namespace

bool matches_wildcard(std::string_view pattern, std::string_view text, char any) noexcept {
    auto end = pattern.find(any);
    if (end == std::string_view::npos) {
        return pattern == text;
    }
    if (!text.starts_with(pattern.substr(0, end))) {
        return false;
    }
    text.remove_prefix(end);
    pattern.remove_prefix(end + 1);
    // The first place at which a part fits leaves the most text to the others, so no other place needs to be tried.
    while ((end = pattern.find(any)) != std::string_view::npos) {
        const auto found = position_of(pattern.substr(0, end), text);
        if (found == std::string_view::npos) {
            return false;
        }
        text.remove_prefix(found + end);
        pattern.remove_prefix(end + 1);
    }
    return text.ends_with(pattern);
}

bool is_name_pattern(std::string_view text) noexcept {
    if (text.empty() || text.find("**") != std::string_view::npos) {
        return false;
    }
    while (!text.empty()) {
        const auto part = text.substr(0, text.find('*'));
        if (!part.empty() && !protocol::is_name(part)) {
            return false;
        }
        text.remove_prefix(part.size() == text.size() ? part.size() : part.size() + 1);
    }
    return true;
}

} // namespace cles::security
