// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/plan.hpp"
#include "simulation/world/world.hpp"

#include <cstddef>

namespace cles::simulation {

/// Lives through a plan.
report simulate(const plan& what, planted fault = planted::none, const witness::reader& reader = {});

/// The same twice, and looks whether both runs are the same.
report simulate_twice(const plan& what, planted fault = planted::none);

/// A smaller plan that breaks the same rule: with fewer actions, and fewer hosts where that goes. Looks at `max_runs`
/// plans at most.
plan minimise(const plan& what, rule broken, planted fault = planted::none, std::size_t max_runs = 1500);

} // namespace cles::simulation
