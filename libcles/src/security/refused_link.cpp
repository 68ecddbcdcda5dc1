// SPDX-License-Identifier: BSL-1.0
#include "security/refused_link.hpp"

namespace cles::security {

std::string text_of(const refused_link& link) {
    std::string out{link.why};
    if (!link.source.empty() || !link.key.empty()) {
        out.append(" (").append(link.source).append(link.source.empty() || link.key.empty() ? "" : ", ");
        out.append(link.key.empty() ? "" : "key ").append(link.key).append(")");
    }
    return out;
}

std::string_view log_kind_of(link_admission::reason why) noexcept {
    using reason = link_admission::reason;
    switch (why) {
    case reason::none: break;
    case reason::protocol: return "link.protocol";
    case reason::not_member: return "link.not_member";
    case reason::removed: return "link.removed";
    case reason::other_name: return "link.other_name";
    case reason::by_peer: return "link.by_peer";
    case reason::busy: return "link.busy";
    }
    return "link.none";
}

} // namespace cles::security
