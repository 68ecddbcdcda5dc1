// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

namespace tool {

/// Whether it is known, before asking, that nobody can be heard there: the group is heard by the loopback interface
/// alone, and no program of this host listens to it. To be asked before this program listens there itself.
bool nobody_listens(const cles::multicast_options& where);

} // namespace tool
