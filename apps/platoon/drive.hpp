// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "driver.hpp"
#include "recording.hpp"

#include <optional>
#include <string>
#include <vector>

namespace platoon {

/// Something done to vehicle i at a time of the drive.
struct incident {
    enum kind { vanish, join, leave } what = vanish;
    std::size_t vehicle = 0;
    double at = 0;
};

struct drive_options {
    std::size_t vehicles = 10;
    double seconds = 0; ///< 0: as long as the leader's manoeuvre takes, and five more
    double loss = 0, delay = 0;
    std::uint64_t seed = 1;
    driver_setup like{}; ///< of each vehicle, but its name, place and whom it follows
    std::vector<incident> incidents{};
    cles::multicast_options group{};
    bool insecure = false; ///< on a group beyond this host, where nobody proves who he is
    bool quiet = false;    ///< shows nothing on the way
    bool in_place = false; ///< shows a table that changes in place; otherwise a line each second
};

/// Starts each vehicle as a process of its own, watches them drive, and ends them.
/// \throws cles::error where they cannot: the group cannot be had, others drive there, a vehicle does not start
recording drive(const drive_options& options);

} // namespace platoon
