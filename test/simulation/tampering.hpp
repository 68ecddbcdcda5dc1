// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/dice.hpp"
#include "simulation/planted.hpp"

#include <string>

namespace cles::simulation {

/// What a planted fault does to the lines that a stream is about to carry; nothing, where none is planted.
void tamper_with(std::string& lines, planted fault, dice& chance);

} // namespace cles::simulation
