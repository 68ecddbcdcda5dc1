// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulate_command.hpp"

#include <cles/convert.hpp>

#include "platoon/simulation/wilson.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace platoon {
namespace {

/// The results of all seeds.
struct outcome {
    std::size_t vehicles = 0;
    double hz = 0, loss = 0, burst = 0, delay_ms = 0;
    std::string controller{};
    bool radar = false;
    std::uint64_t first_seed = 0, seeds = 0;
    double string_ratio = 0;                                    ///< the largest
    double stable_ratio = 0;                                    ///< above it, a drive counts as unstable
    std::uint64_t unstable = 0;                                 ///< drives, with those in `broken`
    std::uint64_t broken = 0;                                   ///< drives at whose end vehicles stand or are apart
    bool ended = true;                                          ///< the manoeuvre, in each drive
    double failure_rate = 0, failure_low = 0, failure_high = 0; ///< of string stability, with its 95 % interval
    double first_ratio = NAN;                                   ///< the largest error over that behind the leader
    double above_first_rate = 0, above_first_low = 0,
           above_first_high = 0;     ///< of drives in which it is above `stable_ratio`
    double acceleration_ratio = NAN; ///< the largest
    std::uint64_t collisions = 0;    ///< drives
    double collision_low = 0, collision_high = 0;
    double least_gap = INFINITY;
    double least_time_to_collision = NAN;        ///< s; null: nobody ever came nearer
    amplification braking{}, recovery{}, sine{}; ///< the largest of each vehicle
    bool collision = false;
    double fallbacks = 0;    ///< of one drive, on average
    double radar_spells = 0; ///< how often a vehicle followed by its radar alone, in one drive, on average
    std::vector<verdict> runs{};
};
BOOST_DESCRIBE_STRUCT(outcome, (),
                      (vehicles, hz, loss, burst, delay_ms, controller, radar, first_seed, seeds, string_ratio,
                       stable_ratio, unstable, broken, ended, failure_rate, failure_low, failure_high, first_ratio,
                       above_first_rate, above_first_low, above_first_high, acceleration_ratio, collisions,
                       collision_low, collision_high, least_gap, least_time_to_collision, braking, recovery, sine,
                       collision, fallbacks, radar_spells, runs))

/// Whether errors behind a vehicle may be compared with those ahead of it: the platoon stays the same.
bool is_steady(const scenario& what) { return what.incidents.empty(); }

recording record_of(scenario what, bool with_courses) {
    recording out{.source = "simulated",
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
                extend(joined, {.x = NAN, .v = NAN, .a = NAN}, NAN, NAN);
            }
            out.courses.push_back(std::move(joined));
        }
        out.t.push_back(now);
        for (std::size_t i = 0; i < all.size(); ++i) {
            extend(out.courses[i], all[i].where, all[i].distance, all[i].desired);
        }
    });
    return out;
}

void print_all(const outcome& all) {
    std::printf("all       string ratio %.4f at most, gap %.3f m at least\n", all.string_ratio, all.least_gap);
    if (!all.ended) {
        std::puts("ended     no: the drives were over before the manoeuvre, so they do not show string stability");
        if (all.broken > 0) {
            std::printf("broken    %ju of %ju drives, at whose end vehicles stand or are apart\n",
                        std::uintmax_t{all.broken}, std::uintmax_t{all.seeds});
        }
    } else {
        std::printf(
            "failures  %ju of %ju drives above a string ratio of %g%s: %.2f %% (95 %% interval %.2f to %.2f %%)\n",
            std::uintmax_t{all.unstable}, std::uintmax_t{all.seeds}, all.stable_ratio,
            all.broken > 0 ? ", or with vehicles that stand or are apart" : "", all.failure_rate * 100,
            all.failure_low * 100, all.failure_high * 100);
    }
    if (all.ended && !std::isnan(all.first_ratio)) {
        std::printf(
            "first     errors of up to %.4f times the one behind the leader; above %g: %.2f %% of the drives (95 %% "
            "interval %.2f to %.2f %%)\n",
            all.first_ratio, all.stable_ratio, all.above_first_rate * 100, all.above_first_low * 100,
            all.above_first_high * 100);
    }
    if (!std::isnan(all.acceleration_ratio)) {
        std::printf("hardest   accelerations of up to %.4f times those of the leader\n", all.acceleration_ratio);
    }
    std::fputs(gains_line("braking  ", all.braking).c_str(), stdout);
    std::fputs(gains_line("recovery ", all.recovery).c_str(), stdout);
    std::fputs(gains_line("sine     ", all.sine).c_str(), stdout);
    std::printf("collided  %ju of %ju drives (95 %% interval %.2f to %.2f %%)\n", std::uintmax_t{all.collisions},
                std::uintmax_t{all.seeds}, all.collision_low * 100, all.collision_high * 100);
    std::printf("in each   %.2f fallbacks, %.2f spells with the radar alone, on average\n", all.fallbacks,
                all.radar_spells);
}

constexpr unsigned most_lines = 20;

} // namespace

int simulate_command(scenario what, unsigned seeds, bool json, const std::string& record) {
    outcome all{.vehicles = what.vehicles,
                .hz = what.setup.hz,
                .loss = what.losses.mean_loss(),
                .burst = what.losses.to_good > 0 ? 1 / what.losses.to_good : 0,
                .delay_ms = what.delay * 1000,
                .controller = what.setup.uses_leader ? "leader" : "predecessor",
                .radar = what.setup.radar.fitted,
                .first_seed = what.seed,
                .seeds = seeds,
                .stable_ratio = stable_ratio};
    const auto first = what.seed;
    std::uint64_t above_first = 0;
    for (; what.seed < first + seeds; ++what.seed) {
        const auto one = record_of(what, what.seed == first && !record.empty());
        if (what.seed == first && !record.empty()) {
            write(one, record);
        }
        all.runs.push_back(one.verdict);
        all.string_ratio = std::max(all.string_ratio, one.verdict.string_ratio);
        all.unstable += is_failure(one.verdict, one.steady) ? 1 : 0;
        if (one.steady) {
            all.broken += one.verdict.stands || one.verdict.apart ? 1 : 0;
            all.ended = all.ended && one.verdict.ended;
            widen(all.braking, one.verdict.braking);
            widen(all.recovery, one.verdict.recovery);
            widen(all.sine, one.verdict.sine);
            all.first_ratio = std::fmax(all.first_ratio, one.verdict.first_ratio);
            above_first += one.verdict.first_ratio > stable_ratio ? 1 : 0;
            all.acceleration_ratio = std::fmax(all.acceleration_ratio, one.verdict.acceleration_ratio);
        }
        all.least_gap = std::fmin(all.least_gap, one.verdict.least_gap);
        all.least_time_to_collision = std::fmin(all.least_time_to_collision, one.verdict.least_time_to_collision);
        all.collisions += one.verdict.collision ? 1 : 0;
        all.fallbacks += static_cast<double>(one.fallbacks) / seeds;
        all.radar_spells += static_cast<double>(one.radar_spells) / seeds;
        if (!json && seeds == 1) {
            std::fputs(summary_of(one).c_str(), stdout);
        } else if (!json && seeds <= most_lines) {
            std::printf(
                "seed %-3ju  string ratio %.4f, %.3f m off at most, gap %.3f m at least, %ju fallbacks, %ju spells "
                "with the radar alone\n",
                std::uintmax_t{what.seed}, one.verdict.string_ratio,
                *std::max_element(one.verdict.error.begin(), one.verdict.error.end()), one.verdict.least_gap,
                std::uintmax_t{one.fallbacks}, std::uintmax_t{one.radar_spells});
        }
    }
    all.collision = all.collisions > 0;
    all.failure_rate = static_cast<double>(all.unstable) / seeds;
    const auto failures = wilson_interval(all.unstable, seeds);
    all.failure_low = failures.low;
    all.failure_high = failures.high;
    all.above_first_rate = static_cast<double>(above_first) / seeds;
    const auto grown = wilson_interval(above_first, seeds);
    all.above_first_low = grown.low;
    all.above_first_high = grown.high;
    const auto collisions = wilson_interval(all.collisions, seeds);
    all.collision_low = collisions.low;
    all.collision_high = collisions.high;
    if (json) {
        std::puts(cles::to_json(all).c_str());
    } else if (seeds > 1) {
        print_all(all);
    }
    return all.collision || all.broken > 0 ? 1 : all.ended ? 0 : 4;
}

} // namespace platoon
