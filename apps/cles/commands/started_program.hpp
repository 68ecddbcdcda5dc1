// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace tool {

/// Replaces this program by another one, so that its exit code, its terminal and the signals to it are those of this
/// process. It is looked for beside this program, then in PATH.
/// \param words the arguments of this program, ended by a null pointer; those after `command` are passed on
/// \param advice says when the program is there
[[noreturn]] void start_program(char** words, std::string_view command, std::string program, const std::string& advice);

} // namespace tool
