// SPDX-License-Identifier: BSL-1.0
#include "commander.hpp"

#include "fixed_number.hpp"

#include <algorithm>

namespace jadc2 {

using cles::errc;

std::string fate_of(const cles::error& why) {
    const auto code = why.code();
    if (code == errc::unavailable || code == errc::deadline || code == errc::cancelled || code == errc::stopped) {
        return "unknown";
    }
    const bool not_begun =
        could_not_be_reached(why) || code == errc::busy || code == errc::no_task || code == errc::denied;
    return not_begun ? "refused" : "failed";
}

std::string text_of(const order_fates& all) {
    const auto number = [](std::uint64_t count, const char* what) { return std::to_string(count) + what; };
    return number(all.given, " orders: ") + number(all.done, " released (") + number(all.hit, " hit, ") +
           number(all.missed, " missed, ") + number(all.unseen, " not seen), ") + number(all.refused, " refused, ") +
           number(all.failed, " failed, ") + number(all.aborted, " aborted, ") + number(all.unknown, " unknown");
}

int exit_code_of(const order_fates& all) {
    return all.unknown != 0 || all.unseen != 0                      ? 4
           : all.failed != 0                                        ? 5
           : all.missed != 0                                        ? 7
           : all.refused != 0 || all.aborted != 0 || all.given == 0 ? 3
                                                                    : 0;
}

// Codes of other categories are those of connections that could not be made.
bool could_not_be_reached(const cles::error& why) {
    return why.code().category() != cles::error_category() || why.code() == errc::no_target;
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
        const bool fits = t.age >= seconds && t.missed == 0 && !is_attacked(t);
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

bool commander::is_attacked(const fmv::track& target) const {
    const auto& engaged = latest_.engaged;
    return struck_.contains({latest_.by, target.id}) ||
           (engaged && std::find(engaged->begin(), engaged->end(), target.id) != engaged->end());
}

std::string commander::objection(const fmv::track& target, bool again, double now, double oldest_s) const {
    const auto number = std::to_string(target.id);
    if (const double age = now - latest_.captured; age > oldest_s) {
        return "the picture of target " + number + " is " + fixed(age, 1) + " s old: " + fixed(oldest_s, 1) +
               " at most";
    }
    if (is_attacked(target) && !again) {
        return "target " + number + " is under attack or hit: write strike " + number + " again, to attack it again";
    }
    return {};
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
       : fate == "aborted" ? fates_.aborted
                           : fates_.unknown);
}

void commander::assessed(std::optional<bool> hit) { ++(!hit ? fates_.unseen : *hit ? fates_.hit : fates_.missed); }

} // namespace jadc2
