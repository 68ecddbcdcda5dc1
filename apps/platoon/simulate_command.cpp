// SPDX-License-Identifier: BSL-1.0
#include "simulate_command.hpp"

#include <cles/convert.hpp>

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace platoon {
namespace {

/// The results of all seeds.
struct outcome {
    std::size_t vehicles = 0;
    double hz = 0, loss = 0, delay_ms = 0;
    std::string controller{};
    double string_ratio = 0; ///< the largest
    double least_gap = 0;
    bool collision = false;
    double fallbacks = 0; ///< of one drive, on average
    std::vector<verdict> runs{};
};
BOOST_DESCRIBE_STRUCT(outcome, (),
                      (vehicles, hz, loss, delay_ms, controller, string_ratio, least_gap, collision, fallbacks, runs))

recording record_of(scenario what) {
    recording out{.source = "simulated",
                  .vehicles = what.vehicles,
                  .hz = what.setup.hz,
                  .loss = what.loss,
                  .delay_ms = what.delay * 1000,
                  .spacing = what.setup.spacing,
                  .seed = what.seed,
                  .steady = what.vanish < 0};
    what.on_change = [&](double t, const std::string& vehicle, role mode, const std::string& why) {
        out.events.push_back({t, vehicle, boost::describe::enum_to_string(mode, ""), why});
        out.fallbacks += mode == role::fallback ? 1 : 0;
    };
    for (std::size_t i = 0; i < what.vehicles; ++i) {
        out.courses.push_back({.vehicle = name_of(i)});
    }
    long looks = 0;
    out.verdict = simulate(what, [&](double now, const std::vector<motion>& where) {
        if (looks++ % 5 != 0) {
            return;
        }
        out.t.push_back(now);
        const auto errors = spacing_errors(where, what.setup.spacing);
        for (std::size_t i = 0; i < where.size(); ++i) {
            out.courses[i].speed.push_back(where[i].v);
            out.courses[i].error.push_back(i == 0 ? NAN : errors[i - 1]);
        }
    });
    return out;
}

} // namespace

int simulate_command(scenario what, unsigned seeds, bool json, const std::string& record) {
    outcome all{.vehicles = what.vehicles,
                .hz = what.setup.hz,
                .loss = what.loss,
                .delay_ms = what.delay * 1000,
                .controller = what.setup.uses_leader ? "leader" : "predecessor",
                .least_gap = INFINITY};
    for (what.seed = 1; what.seed <= seeds; ++what.seed) {
        const auto one = record_of(what);
        if (what.seed == 1 && !record.empty()) {
            write(one, record);
        }
        all.runs.push_back(one.verdict);
        all.string_ratio = std::max(all.string_ratio, one.verdict.string_ratio);
        all.least_gap = std::min(all.least_gap, one.verdict.least_gap);
        all.collision = all.collision || one.verdict.collision;
        all.fallbacks += static_cast<double>(one.fallbacks) / seeds;
        if (!json && seeds == 1) {
            std::fputs(summary_of(one).c_str(), stdout);
        } else if (!json) {
            std::printf("seed %-3ju  string ratio %.4f, %.3f m off at most, gap %.3f m at least, %ju fallbacks\n",
                        std::uintmax_t{what.seed}, one.verdict.string_ratio,
                        *std::max_element(one.verdict.error.begin(), one.verdict.error.end()), one.verdict.least_gap,
                        std::uintmax_t{one.fallbacks});
        }
    }
    if (json) {
        std::puts(cles::to_json(all).c_str());
    } else if (seeds > 1) {
        std::printf("all       string ratio %.4f at most, gap %.3f m at least\n", all.string_ratio, all.least_gap);
    }
    return all.collision ? 1 : 0;
}

} // namespace platoon
