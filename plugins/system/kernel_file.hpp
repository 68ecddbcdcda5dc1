// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace sysinfo {

/// The whole of a file that the kernel makes up as it is read, up to 4 MiB.
/// \throws cles::error with `failed`, which names its content, if it cannot be read
std::string read_kernel_file(const char* path, const char* what);

/// The same where the file may be gone: empty then.
std::string read_if_there(const char* path);

} // namespace sysinfo
