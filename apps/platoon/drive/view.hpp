// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/logbook.hpp"
#include "platoon/driver/vehicle_report.hpp"

#include <string>
#include <vector>

namespace platoon {

/// An overview of the platoon for a terminal: a line per vehicle, in driving order. A vehicle is silent if no update
/// was received for `silent_after` seconds.
std::string table_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                     double silent_after);
/// The same in one line.
std::string line_of(const logbook& book, const std::vector<std::string>& vehicles, double t, double spacing,
                    double silent_after);

/// What has happened to a vehicle, in one line.
std::string line_of(const event& what);

} // namespace platoon
