// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace tool {

/// When the program ends, checks that what it has printed by stdio or `std::cout` was written. If not, it says so in
/// one line on stderr, and ends with that code, whatever the program's own is; a reader that has closed a pipe is no
/// error. To be called once, before anything is printed.
void check_output_at_exit(const char* program, int code = 1);

} // namespace tool
