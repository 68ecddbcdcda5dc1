// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "logbook.hpp"

#include <string>
#include <vector>

namespace platoon {

/// The platoon at a glance, for a terminal: a line per vehicle, in the order in which they drive. A vehicle is silent
/// when nothing was heard of it for so many seconds.
std::string table_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                     double silent_after);
/// The same in one line.
std::string line_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                    double silent_after);

} // namespace platoon
