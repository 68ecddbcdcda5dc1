// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "platoon/drive/recording.hpp"
#include "platoon/driver/driver.hpp"

#include <string>

namespace platoon {

struct watch_options {
    double seconds = 0;   ///< 0: until SIGINT or SIGTERM
    driver_setup setup{}; ///< what is known of all vehicles
    cles::multicast_options group{};
    bool insecure = false;
    std::string keys{}; ///< the directory with the key of a member that may bind states; empty: without security
    bool quiet = false;
    bool in_place = false;
};

/// Watches the vehicles of a group, whoever has started them.
/// \throws cles::error `no_target` if there are none
recording watch(const watch_options& options);

} // namespace platoon
