// SPDX-License-Identifier: BSL-1.0
#include <cles/plugin.hpp>

// A job that does nothing, to measure what surrounds it.
static void register_tasks(cles::registrar& to) {
    to.on_delegate("empty", [] {});
}

CLES_PLUGIN("empty", "1.0", register_tasks)
