// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace cles::protocol {

/// Whether rights and rules do not apply to a noun, so that every member may request it (docs/protocol_security.md,
/// "Rights"): it concerns the link, the trust between nodes, or workers that they offer each other for jobs that have
/// rights.
/// \param what its first parameter; empty: it has none
constexpr bool is_exempt_from_rights(std::string_view task, std::string_view what) noexcept {
    constexpr std::array<std::string_view, 6> exempt{"cancel", "hello", "leaving", "roster", "announced", "slots"};
    return task == "cles" && std::find(exempt.begin(), exempt.end(), what) != exempt.end();
}

} // namespace cles::protocol
