// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cmath>
#include <cstddef>

namespace platoon {

/// What happens to a vehicle at a time of the drive.
struct incident {
    enum kind {
        mute,   ///< its radio fails: it drives on, but sends nothing
        vanish, ///< it stops sending, and has no driver any more
        join,   ///< it joins at the end of the platoon; in a simulation, as `merge`
        merge,  ///< a further vehicle joins behind it, in the middle of the platoon
        split,  ///< it and those behind it become a platoon of their own
        leave   ///< it leaves the lane
    } what = vanish;
    std::size_t vehicle = 0;
    double at = 0;           ///< s
    double lasts = INFINITY; ///< s, if it is mute
};

} // namespace platoon
