// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace CLI {
class App;
}

namespace tool {

/// Adds `cles bench`, which leaves its exit code when it has run.
void add_bench(CLI::App& app, int& exit_code);

} // namespace tool
