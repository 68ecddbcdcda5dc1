// SPDX-License-Identifier: BSL-1.0
#include <cles/plugin.hpp>
#include <cles/version.hpp>

#include "tasks.hpp"

CLES_PLUGIN("digits", cles::version, digits::register_tasks)
