// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/descriptor.hpp"

#include <string>

namespace cles::perf {

/// Makes a network device of that name whose frames this process carries: what the system sends by it can be read, and
/// what is written arrives there. It goes with the descriptor, into whatever network namespace it was moved, and does
/// not block. \throws std::system_error where it may not be made, or the name is taken
descriptor make_tap(const std::string& name);

} // namespace cles::perf
