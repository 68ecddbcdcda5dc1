// SPDX-License-Identifier: BSL-1.0
#include <cles/plugin.hpp>
#include <cles/version.hpp>

#include "system.hpp"

CLES_PLUGIN("system", cles::version, sysinfo::register_tasks)
