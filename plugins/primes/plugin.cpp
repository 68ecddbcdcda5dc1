// SPDX-License-Identifier: BSL-1.0
#include <cles/plugin.hpp>
#include <cles/version.hpp>

#include "primes.hpp"

CLES_PLUGIN("primes", cles::version, primes::register_tasks)
