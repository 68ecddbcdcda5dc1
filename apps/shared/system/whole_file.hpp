// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string>
#include <system_error>

namespace tool {

/// Reads a file, or its first `most` bytes. Unlike with `std::ifstream`, a program that another thread starts meanwhile
/// does not inherit it.
/// \return why it cannot be read
std::error_code read_file(const std::string& path, std::string& to, std::size_t most = std::string::npos);
/// The same with one that is open: what follows.
std::error_code read_open_file(int descriptor, std::string& to, std::size_t most);

} // namespace tool
