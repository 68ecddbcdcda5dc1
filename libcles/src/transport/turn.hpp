// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::transport {

/// What one turn of the executor may take from one link, so that a flooded one leaves the others theirs.
inline constexpr int lines_per_turn = 1024;

} // namespace cles::transport
