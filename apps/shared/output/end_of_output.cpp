// SPDX-License-Identifier: BSL-1.0
#include "output/end_of_output.hpp"

#include "output/terminal.hpp"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <system_error>

namespace tool {
namespace {

struct {
    const char* program = "";
    int code = 1;
} at_exit;

void check_output() {
    const bool has_failed = std::ferror(stdout) != 0; // an earlier write, so the reason is not known any more
    const int why = std::fflush(stdout) == 0 ? 0 : errno;
    if ((why == 0 && !has_failed) || why == EPIPE || is_output_closed()) {
        return;
    }
    auto line = std::string{at_exit.program} + ": cannot write the output";
    if (why != 0) {
        line += ": " + std::generic_category().message(why);
    }
    write_within(stream::err, line + "\n", std::chrono::seconds{1});
    std::_Exit(at_exit.code);
}

} // namespace

void check_output_at_exit(const char* program, int code) {
    at_exit = {.program = program, .code = code};
    static_cast<void>(std::atexit(check_output));
}

} // namespace tool
