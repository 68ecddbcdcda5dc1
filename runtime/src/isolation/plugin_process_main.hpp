// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::runtime {

/// Whether the program was started to run an isolated plugin (`plugin_process`).
bool is_plugin_process(int argc, const char* const* argv) noexcept;

/// Runs an isolated plugin in this process until the daemon ends it. Returns an exit code only if it was not started by
/// a daemon.
int run_plugin_process(int argc, const char* const* argv);

} // namespace cles::runtime
