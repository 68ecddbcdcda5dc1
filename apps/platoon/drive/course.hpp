// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/drive/drive.hpp"
#include "platoon/drive/logbook.hpp"

#include <string>
#include <vector>

namespace platoon {

/// The record of a drive, from its logbook. \param first the vehicles at the start, in their order \param all vehicles
/// that took part
recording course_of(const logbook& book, const std::vector<std::string>& first, const std::vector<std::string>& all,
                    double end, const drive_options& how);

} // namespace platoon
