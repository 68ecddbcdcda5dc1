// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulate_command.hpp"

#include <cles/convert.hpp>

#include "platoon/simulation/outcome.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace platoon {
namespace {

/// Whether errors behind a vehicle may be compared with those ahead of it: the platoon stays the same.
bool is_steady(const scenario& what) { return what.incidents.empty(); }

recording record_of(scenario what, bool with_courses) {
    recording out{.source = "control law",
                  .vehicles = what.vehicles,
                  .hz = what.setup.hz,
                  .loss = what.losses.mean_loss(),
                  .burst = what.losses.to_good > 0 ? 1 / what.losses.to_good : 0,
                  .delay_ms = what.delay * 1000,
                  .spacing = what.setup.spacing,
                  .seed = what.seed,
                  .steady = is_steady(what)};
    what.on_change = [&](double t, const std::string& vehicle, role mode, const std::string& why) {
        if (with_courses) {
            out.events.push_back({t, vehicle, boost::describe::enum_to_string(mode, ""), why});
        }
        out.fallbacks += mode == role::fallback ? 1 : 0;
        out.radar_spells += mode == role::radar ? 1 : 0;
    };
    if (!with_courses) {
        out.verdict = simulate(what);
        return out;
    }
    long looks = 0;
    out.verdict = simulate(what, [&](double now, const std::vector<sighting>& all) {
        if (looks++ % 5 != 0) {
            return;
        }
        while (out.courses.size() < all.size()) { // it has joined
            course joined{.vehicle = name_of(out.courses.size())};
            for (std::size_t i = 0; i < out.t.size(); ++i) {
                extend(joined, {.x = NAN, .v = NAN, .a = NAN}, NAN, NAN, "");
            }
            out.courses.push_back(std::move(joined));
        }
        out.t.push_back(now);
        for (std::size_t i = 0; i < all.size(); ++i) {
            extend(out.courses[i], all[i].where, all[i].distance, all[i].desired,
                   boost::describe::enum_to_string(all[i].mode, ""));
        }
    });
    return out;
}

constexpr unsigned most_lines = 20;

} // namespace

int simulate_command(scenario what, unsigned seeds, bool json, const std::string& record) {
    auto all = outcome_of(what);
    const auto first = what.seed;
    for (; what.seed < first + seeds; ++what.seed) {
        const auto one = record_of(what, what.seed == first && !record.empty());
        if (what.seed == first && !record.empty()) {
            write(one, record);
        }
        const drive_result result{
            .verdict = one.verdict, .steady = one.steady, .fallbacks = one.fallbacks, .radar_spells = one.radar_spells};
        add(all, result);
        if (!json && seeds == 1) {
            std::fputs(summary_of(one).c_str(), stdout);
        } else if (!json && seeds <= most_lines) {
            std::fputs(line_of(what.seed, result).c_str(), stdout);
        }
    }
    if (json) {
        std::puts(cles::to_json(all).c_str());
    } else if (seeds > 1) {
        std::fputs(summary_of(all).c_str(), stdout);
    }
    return exit_code_of(all);
}

} // namespace platoon
