// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::runtime {

/// The program: reads what it is told, runs a daemon, and returns the exit code. 0 ok, 1 it could not run, 2 the
/// command line or the configuration is wrong, 3 another node has the name.
int clesd(int argc, const char* const* argv);

} // namespace cles::runtime
