// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace CLI {
class App;
}

namespace tool {

struct context;

/// Adds `show` to the commands of `cles fleet`.
void add_fleet_show(CLI::App& fleet, context& shared);

} // namespace tool
