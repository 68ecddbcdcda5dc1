// SPDX-License-Identifier: BSL-1.0
#include "output/diagnostics.hpp"

#include "output/terminal.hpp"

#include <cstdio>
#include <string>

namespace tool {
namespace {

// One write, so that lines of several processes do not mix.
void say(const std::string& line) { std::fwrite(line.data(), 1, line.size(), stderr); }

} // namespace

void complain(std::string_view text) { say(red(stream::err, "cles:") + " " + printable(text) + "\n"); }

void note(std::string_view text) { say("cles: " + printable(text) + "\n"); }

} // namespace tool
