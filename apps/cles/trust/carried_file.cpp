// SPDX-License-Identifier: BSL-1.0
#include "trust/carried_file.hpp"

#include "output/errors.hpp"
#include "system/whole_file.hpp"

#include <cerrno>
#include <cstddef>
#include <ios>
#include <iostream>
#include <string>
#include <system_error>

namespace tool {
namespace {

constexpr std::size_t max_line = 1'000'000;

constexpr std::size_t most_read = max_line + 2; // with its LF, and a byte more

std::error_code read_stdin(std::string& to) {
    to.resize(most_read);
    std::cin.read(to.data(), static_cast<std::streamsize>(to.size()));
    to.resize(static_cast<std::size_t>(std::cin.gcount()));
    return {std::cin.bad() ? errno : 0, std::generic_category()};
}

} // namespace

std::string carried_file_name(const std::string& name) { return name == "-" ? "stdin" : name; }

std::string read_carried_file(const std::string& name) {
    std::string line;
    const auto origin = carried_file_name(name);
    if (const auto why = name == "-" ? read_stdin(line) : read_file(name, line, most_read)) {
        throw usage_error("cannot read " + origin + ": " + why.message());
    }
    if (line.ends_with('\n')) {
        line.pop_back();
    }
    if (line.size() > max_line) {
        throw usage_error(origin + " is longer than any file that is carried between nodes");
    }
    return line;
}

} // namespace tool
