// SPDX-License-Identifier: BSL-1.0
#include "security/refused_links.hpp"

namespace cles::security {

bool refused_links::take(const refused_link& link, time_point now) {
    auto& logged = logged_[link.kind];
    while (!logged.empty() && now - logged.front().at >= log_again_after) {
        logged.pop_front();
    }
    std::size_t of_source = 0;
    for (const auto& each : logged) {
        if (each.source == link.source) {
            ++of_source;
            if (each.why == link.why) {
                return false;
            }
        }
    }
    if (of_source >= most_of_source || logged.size() >= most_of_kind) {
        return false;
    }
    logged.push_back({.source = std::string{link.source}, .why = std::string{link.why}, .at = now});
    return true;
}

} // namespace cles::security
