// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/course.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double sample_step = 0.01, record_step = 0.05; // s: for the verdict, and for the record

/// Each one's distance to the vehicle that is ahead of it at that time, in the order of `where`.
std::vector<double> distances_of(const std::vector<std::optional<motion>>& where) {
    std::vector<double> distances(where.size(), NAN);
    for (std::size_t i = 0; i < where.size(); ++i) {
        double ahead = INFINITY;
        for (std::size_t k = 0; k < where.size() && where[i]; ++k) {
            if (k != i && where[k] && where[k]->x > where[i]->x) {
                ahead = std::min(ahead, where[k]->x);
            }
        }
        if (std::isfinite(ahead)) {
            distances[i] = ahead - where[i]->x;
        }
    }
    return distances;
}

} // namespace

recording course_of(const logbook& book, const std::vector<std::string>& first, const std::vector<std::string>& all,
                    double end, const drive_options& how) {
    recording out{.source = "driven",
                  .vehicles = how.vehicles,
                  .hz = how.setup.hz,
                  .loss = how.loss,
                  .burst = how.burst,
                  .delay_ms = how.delay * 1000,
                  .spacing = how.setup.spacing,
                  .seed = how.seed};
    assessment spacing_assessment{first.size(), how.setup.spacing, how.setup.limits.length};
    const auto limits = limits_of(how.vehicles, how.differences, how.setup.limits, how.seed);
    std::vector<double> desired;
    std::size_t previous = 0;
    for (std::size_t i = 0; i < how.vehicles; ++i) {
        if (std::find(first.begin(), first.end(), name_of(i)) != first.end()) {
            desired.push_back(
                wanted_distance(how.setup.spacing, how.setup.plan.speed, limits[i].brake, limits[previous].brake));
            previous = i;
        }
    }
    double least = NAN;
    for (long step = 0; static_cast<double>(step) * sample_step < end; ++step) {
        const double t = static_cast<double>(step) * sample_step;
        std::vector<motion> those_first;
        std::vector<motion> present;
        std::vector<std::optional<motion>> where;
        for (const auto& name : all) {
            where.push_back(book.position(name, t));
            if (where.back()) {
                present.push_back(*where.back());
            }
        }
        for (const auto& name : first) {
            if (const auto at = book.position(name, t)) {
                those_first.push_back(*at);
            }
        }
        if (t >= how.setup.plan.recovery()) {
            spacing_assessment.begin_recovery();
        }
        if (those_first.size() == first.size()) {
            spacing_assessment.sample(those_first, desired);
        }
        least = std::fmin(least, least_gap(present, how.setup.limits.length));
        if (step % std::lround(record_step / sample_step) != 0) {
            continue;
        }
        out.t.push_back(t);
        out.courses.resize(all.size());
        const auto distances = distances_of(where);
        for (std::size_t i = 0; i < all.size(); ++i) {
            out.courses[i].vehicle = all[i];
            extend(out.courses[i], where[i].value_or(motion{.x = NAN, .v = NAN, .a = NAN}), distances[i],
                   how.setup.spacing);
        }
    }
    out.verdict = spacing_assessment.result();
    out.verdict.least_gap = least;
    out.verdict.collision = least <= 0;
    out.verdict.ended = end >= how.setup.plan.end();
    return out;
}

} // namespace platoon
