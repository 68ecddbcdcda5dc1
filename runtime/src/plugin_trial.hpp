// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

namespace cles::runtime {

/// Loads a library in a child process, and says what went wrong; empty where nothing did.
///
/// What a library runs when it is loaded cannot be guarded against in the process that loads it: an exception out of a
/// constructor of a global object ends the process, and so does a crash there, and one that never returns holds it. The
/// child's last words are part of what is returned. Costs a few milliseconds. To be called before the process has
/// other threads, or at least before those matter: the child is a copy of this thread alone.
std::string try_library(const std::filesystem::path& file, std::chrono::milliseconds limit);

} // namespace cles::runtime
