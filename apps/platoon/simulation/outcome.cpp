// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/outcome.hpp"

#include "platoon/simulation/wilson.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <utility>

namespace platoon {
namespace {

[[gnu::format(printf, 2, 3)]] void append(std::string& to, const char* format, ...) {
    std::array<char, 400> text{};
    std::va_list arguments;
    va_start(arguments, format);
    const int length = std::vsnprintf(text.data(), text.size(), format, arguments);
    va_end(arguments);
    to.append(text.data(), std::min(text.size() - 1, static_cast<std::size_t>(length)));
}

} // namespace

bool is_failure(const verdict& result, bool steady) {
    const bool judged = result.ended || !steady;
    return (judged && result.string_ratio > stable_ratio) || (steady && (result.stands || result.apart));
}

int exit_code_of(const verdict& result, bool steady) {
    if (result.collision || (steady && (result.stands || result.apart))) {
        return 1;
    }
    return steady && !result.ended ? 4 : 0;
}

std::string gains_line(const char* heading, const amplification& gains_of_each) {
    std::string text;
    for (const auto& [what, each] :
         {std::pair{"errors", &gains_of_each.error}, std::pair{"speeds", &gains_of_each.speed},
          std::pair{"accelerations", &gains_of_each.acceleration}}) {
        const double most = largest(*each);
        if (!std::isnan(most)) {
            append(text, "%s %s %.4f", text.empty() ? "" : ",", what, most);
        }
    }
    return text.empty() ? "" : std::string{heading} + text + " times those of the one ahead, at most\n";
}

outcome outcome_of(const scenario& what) {
    return {.vehicles = what.vehicles,
            .hz = what.setup.hz,
            .loss = what.losses.mean_loss(),
            .burst = what.losses.to_good > 0 ? 1 / what.losses.to_good : 0,
            .delay_ms = what.delay * 1000,
            .controller = what.setup.uses_leader ? "leader" : "predecessor",
            .radar = what.setup.radar.fitted,
            .first_seed = what.seed};
}

void add(outcome& to, const drive_result& drive) {
    const auto& one = drive.verdict;
    const auto before = static_cast<double>(to.seeds);
    const auto seeds = static_cast<double>(++to.seeds);
    to.runs.push_back(one);
    to.string_ratio = std::max(to.string_ratio, one.string_ratio);
    to.unstable += is_failure(one, drive.steady) ? 1 : 0;
    double above_first = std::round(to.above_first_rate * before);
    if (drive.steady) {
        to.broken += one.stands || one.apart ? 1 : 0;
        to.ended = to.ended && one.ended;
        widen(to.braking, one.braking);
        widen(to.recovery, one.recovery);
        widen(to.sine, one.sine);
        to.first_ratio = std::fmax(to.first_ratio, one.first_ratio);
        above_first += one.first_ratio > stable_ratio ? 1 : 0;
        to.acceleration_ratio = std::fmax(to.acceleration_ratio, one.acceleration_ratio);
    }
    to.least_gap = std::fmin(to.least_gap, one.least_gap);
    to.least_time_to_collision = std::fmin(to.least_time_to_collision, one.least_time_to_collision);
    to.collisions += one.collision ? 1 : 0;
    to.collision = to.collisions > 0;
    to.fallbacks = (to.fallbacks * before + static_cast<double>(drive.fallbacks)) / seeds;
    to.radar_spells = (to.radar_spells * before + static_cast<double>(drive.radar_spells)) / seeds;
    to.failure_rate = static_cast<double>(to.unstable) / seeds;
    const auto failures = wilson_interval(to.unstable, to.seeds);
    to.failure_low = failures.low;
    to.failure_high = failures.high;
    to.above_first_rate = above_first / seeds;
    const auto grown = wilson_interval(static_cast<std::uint64_t>(above_first), to.seeds);
    to.above_first_low = grown.low;
    to.above_first_high = grown.high;
    const auto collisions = wilson_interval(to.collisions, to.seeds);
    to.collision_low = collisions.low;
    to.collision_high = collisions.high;
}

std::string line_of(std::uint64_t seed, const drive_result& drive) {
    const auto& one = drive.verdict;
    std::string text;
    append(text,
           "seed %-3ju  string ratio %.4f, %.3f m off at most, gap %.3f m at least, %ju fallbacks, %ju spells with the "
           "radar alone\n",
           std::uintmax_t{seed}, one.string_ratio, *std::max_element(one.error.begin(), one.error.end()), one.least_gap,
           std::uintmax_t{drive.fallbacks}, std::uintmax_t{drive.radar_spells});
    return text;
}

std::string summary_of(const outcome& all) {
    std::string text;
    append(text, "all       string ratio %.4f at most, gap %.3f m at least\n", all.string_ratio, all.least_gap);
    if (!all.ended) {
        text += "ended     no: the drives were over before the manoeuvre, so they do not show string stability\n";
        if (all.broken > 0) {
            append(text, "broken    %ju of %ju drives, at whose end vehicles stand or are apart\n",
                   std::uintmax_t{all.broken}, std::uintmax_t{all.seeds});
        }
    } else {
        append(text,
               "failures  %ju of %ju drives above a string ratio of %g%s: %.2f %% (95 %% interval %.2f to %.2f %%)\n",
               std::uintmax_t{all.unstable}, std::uintmax_t{all.seeds}, all.stable_ratio,
               all.broken > 0 ? ", or with vehicles that stand or are apart" : "", all.failure_rate * 100,
               all.failure_low * 100, all.failure_high * 100);
    }
    if (all.ended && !std::isnan(all.first_ratio)) {
        append(text,
               "first     errors of up to %.4f times the one behind the leader; above %g: %.2f %% of the drives (95 %% "
               "interval %.2f to %.2f %%)\n",
               all.first_ratio, all.stable_ratio, all.above_first_rate * 100, all.above_first_low * 100,
               all.above_first_high * 100);
    }
    if (!std::isnan(all.acceleration_ratio)) {
        append(text, "hardest   accelerations of up to %.4f times those of the leader\n", all.acceleration_ratio);
    }
    text += gains_line("braking  ", all.braking);
    text += gains_line("recovery ", all.recovery);
    text += gains_line("sine     ", all.sine);
    append(text, "collided  %ju of %ju drives (95 %% interval %.2f to %.2f %%)\n", std::uintmax_t{all.collisions},
           std::uintmax_t{all.seeds}, all.collision_low * 100, all.collision_high * 100);
    append(text, "in each   %.2f fallbacks, %.2f spells with the radar alone, on average\n", all.fallbacks,
           all.radar_spells);
    return text;
}

int exit_code_of(const outcome& all) { return all.collision || all.broken > 0 ? 1 : all.ended ? 0 : 4; }

} // namespace platoon
