// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/course.hpp"

#include "platoon/driver/motion.hpp"
#include "platoon/simulation/assessment.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

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

recording course_of(const logbook& book, const course_setup& how) {
    recording out;
    assessment spacing_assessment{how.first.size(), how.spacing, how.length};
    std::vector<double> lengths;
    for (const auto& name : how.first) {
        const auto* const last = book.last(name);
        lengths.push_back(last == nullptr ? how.length : last->length);
    }
    double least = NAN;
    for (long step = std::lround(how.from / sample_step); static_cast<double>(step) * sample_step < how.end; ++step) {
        const double t = static_cast<double>(step) * sample_step;
        std::vector<motion> those_first;
        std::vector<placed> present;
        std::vector<std::optional<motion>> where;
        for (const auto& name : how.all) {
            where.push_back(book.position(name, t));
            if (where.back()) {
                present.push_back({.x = where.back()->x, .length = book.last(name)->length});
            }
        }
        for (const auto& name : how.first) {
            if (const auto at = book.position(name, t)) {
                those_first.push_back(*at);
            }
        }
        if (t >= how.recovery) {
            spacing_assessment.begin_recovery();
        }
        if (t >= how.begin && those_first.size() == how.first.size()) {
            spacing_assessment.sample(those_first, how.desired, lengths);
        }
        least = std::fmin(least, least_gap(present));
        if (step % std::lround(record_step / sample_step) != 0) {
            continue;
        }
        out.t.push_back(t);
        out.courses.resize(how.all.size());
        const auto distances = distances_of(where);
        for (std::size_t i = 0; i < how.all.size(); ++i) {
            out.courses[i].vehicle = how.all[i];
            extend(out.courses[i], where[i].value_or(motion{.x = NAN, .v = NAN, .a = NAN}), distances[i], how.spacing,
                   where[i] ? boost::describe::enum_to_string(book.mode(how.all[i], t), "") : "");
        }
    }
    out.verdict = spacing_assessment.result();
    out.verdict.least_gap = least;
    out.verdict.collision = least <= 0;
    return out;
}

} // namespace platoon
