// SPDX-License-Identifier: BSL-1.0
#include "course.hpp"

#include <algorithm>
#include <cmath>

namespace platoon {
namespace {

constexpr double sample_step = 0.01, record_step = 0.05; // s: for the verdict, and for the record

/// Each one's distance error to the vehicle that is ahead of it at that time, in the order of `where`.
std::vector<double> errors_of(const std::vector<std::optional<motion>>& where, double spacing) {
    std::vector<double> errors(where.size(), NAN);
    for (std::size_t i = 0; i < where.size(); ++i) {
        double ahead = INFINITY;
        for (std::size_t k = 0; k < where.size() && where[i]; ++k) {
            if (k != i && where[k] && where[k]->x > where[i]->x) {
                ahead = std::min(ahead, where[k]->x);
            }
        }
        if (std::isfinite(ahead)) {
            errors[i] = ahead - where[i]->x - spacing;
        }
    }
    return errors;
}

} // namespace

recording course_of(const logbook& book, const std::vector<std::string>& first, const std::vector<std::string>& all,
                    double end, const drive_options& how) {
    recording out{.source = "driven",
                  .vehicles = how.vehicles,
                  .hz = how.setup.hz,
                  .loss = how.loss,
                  .delay_ms = how.delay * 1000,
                  .spacing = how.setup.spacing,
                  .seed = how.seed};
    assessment spacing_assessment{first.size(), how.setup.spacing, how.setup.limits.length};
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
        if (those_first.size() == first.size()) {
            spacing_assessment.sample(those_first);
        }
        least = std::fmin(least, least_gap(present, how.setup.limits.length));
        if (step % std::lround(record_step / sample_step) != 0) {
            continue;
        }
        out.t.push_back(t);
        out.courses.resize(all.size());
        const auto errors = errors_of(where, how.setup.spacing);
        for (std::size_t i = 0; i < all.size(); ++i) {
            out.courses[i].vehicle = all[i];
            out.courses[i].speed.push_back(where[i] ? where[i]->v : NAN);
            out.courses[i].error.push_back(errors[i]);
        }
    }
    out.verdict = spacing_assessment.result();
    out.verdict.least_gap = least;
    out.verdict.collision = least <= 0;
    return out;
}

} // namespace platoon
