// SPDX-License-Identifier: BSL-1.0
#include "security/refused_links.hpp"

namespace cles::security {

std::string text_of(const refused_link& link) {
    std::string out{link.why};
    if (!link.source.empty() || !link.key.empty()) {
        out.append(" (").append(link.source).append(link.source.empty() || link.key.empty() ? "" : ", ");
        out.append(link.key.empty() ? "" : "key ").append(link.key).append(")");
    }
    return out;
}

bool refused_links::take(const refused_link& link, time_point now) {
    auto& logged = logged_[link.kind];
    while (!logged.empty() && now - logged.front().at >= log_again_after) {
        logged.pop_front();
    }
    std::size_t of_source = 0;
    for (const auto& each : logged) {
        if (each.source == link.source) {
            ++of_source;
            if (each.why == link.why && each.key == link.key) {
                return false;
            }
        }
    }
    if (of_source >= most_of_source || logged.size() >= most_of_kind) {
        return false;
    }
    logged.push_back(
        {.source = std::string{link.source}, .why = std::string{link.why}, .key = std::string{link.key}, .at = now});
    return true;
}

} // namespace cles::security
