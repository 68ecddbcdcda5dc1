// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/logbook.hpp"
#include "platoon/drive/recording.hpp"

#include <string>
#include <vector>

namespace platoon {

/// How a drive is evaluated.
struct course_setup {
    std::vector<std::string> first{}; ///< the vehicles at the start, in their order; at least one
    std::vector<double> desired{};    ///< the distance of each to the one ahead, m; that of the first does not count
    std::vector<std::string> all{};   ///< that took part
    double from = 0, end = 0;         ///< the courses, gaps and collisions are of the time between
    double begin = 0;                 ///< when errors of spacing begin to count
    double spacing = 0, length = 0;
    double recovery = 0; ///< when the second half of the manoeuvre begins
};

/// The courses of all vehicles and the verdict, from a logbook; the rest of the recording is empty.
recording course_of(const logbook& book, const course_setup& how);

} // namespace platoon
