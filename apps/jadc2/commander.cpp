// SPDX-License-Identifier: BSL-1.0
#include "commander.hpp"

#include <algorithm>

namespace jadc2 {

using cles::errc;

std::string fate_of(const cles::error& why) {
    const auto code = why.code();
    if (code == errc::unavailable || code == errc::deadline || code == errc::cancelled || code == errc::stopped) {
        return "unknown";
    }
    const bool not_begun = code.category() != cles::error_category() || code == errc::busy || code == errc::no_target ||
                           code == errc::no_task || code == errc::denied;
    return not_begun ? "refused" : "failed";
}

strike::order order_against(const fmv::track& target, double utc, const std::string& id) {
    return {.id = id,
            .lat = target.lat,
            .lon = target.lon,
            .ve = target.ve,
            .vn = target.vn,
            .sigma = target.sigma,
            .sigma_v = target.sigma_v,
            .utc = utc};
}

std::optional<fmv::track> commander::select_target(double seconds) const {
    std::optional<fmv::track> best;
    for (const auto& t : latest_.tracks) {
        const bool fits = t.age >= seconds && t.missed == 0 && !struck_.contains({latest_.by, t.id});
        if (fits && (!best || t.age > best->age)) {
            best = t;
        }
    }
    return best;
}

std::optional<fmv::track> commander::find(std::uint64_t id) const {
    const auto& all = latest_.tracks;
    const auto at = std::find_if(all.begin(), all.end(), [id](const auto& t) { return t.id == id; });
    return at == all.end() ? std::nullopt : std::optional{*at};
}

void commander::ordered(const fmv::track& target) {
    struck_.emplace(latest_.by, target.id);
    ++fates_.given;
    ++fates_.open;
}

void commander::ended(const std::string& fate) {
    --fates_.open;
    ++(fate == "done"      ? fates_.done
       : fate == "refused" ? fates_.refused
       : fate == "failed"  ? fates_.failed
                           : fates_.unknown);
}

} // namespace jadc2
