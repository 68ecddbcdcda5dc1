// SPDX-License-Identifier: BSL-1.0
#include "trust/carried_file.hpp"

#include "output/errors.hpp"

#include <cerrno>
#include <cstddef>
#include <fstream>
#include <iostream>
#include <istream>
#include <system_error>

namespace tool {
namespace {

constexpr std::size_t max_line = 1'000'000;

std::string line_of(std::istream& in, const std::string& origin) {
    std::string out(max_line + 2, '\0'); // with its LF, and a byte more
    in.read(out.data(), static_cast<std::streamsize>(out.size()));
    if (in.bad()) {
        throw usage_error("cannot read " + origin + ": " + std::generic_category().message(errno));
    }
    out.resize(static_cast<std::size_t>(in.gcount()));
    if (out.ends_with('\n')) {
        out.pop_back();
    }
    if (out.size() > max_line) {
        throw usage_error(origin + " is longer than any file that is carried between nodes");
    }
    return out;
}

} // namespace

std::string carried_file_name(const std::string& name) { return name == "-" ? "stdin" : name; }

std::string read_carried_file(const std::string& name) {
    if (name == "-") {
        return line_of(std::cin, carried_file_name(name));
    }
    std::ifstream file{name, std::ios::binary};
    // A directory can be opened, but not read.
    if (!file || (file.peek() == std::ifstream::traits_type::eof() && errno == EISDIR)) {
        throw usage_error("cannot read " + name + ": " + std::generic_category().message(errno));
    }
    file.clear();
    return line_of(file, name);
}

} // namespace tool
