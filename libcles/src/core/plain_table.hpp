// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "core/presence.hpp"

namespace cles::core {

/// Writes the reply to `PULL self:cles/peers`.
void write_peers(json_writer& w, const presence& others, time_point now);

} // namespace cles::core
