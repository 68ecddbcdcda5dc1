// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/plan.hpp"
#include "simulation/world/world.hpp"

#include <cstddef>

namespace cles::simulation {

/// Runs a plan.
report simulate(const plan& what, planted fault = planted::none, const witness::reader& reader = {});

/// Runs a plan twice, and checks that both runs are identical.
report simulate_twice(const plan& what, planted fault = planted::none);

/// A smaller plan that violates the same rule: with fewer actions, and fewer hosts if possible. Tries at most
/// `max_runs` plans.
plan minimise(const plan& what, rule broken, planted fault = planted::none, std::size_t max_runs = 1500);

} // namespace cles::simulation
