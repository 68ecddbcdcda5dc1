// SPDX-License-Identifier: BSL-1.0
#include "options/body.hpp"

#include <cles/json_reader.hpp>

#include "output/failure.hpp"

#include <cerrno>
#include <fstream>
#include <iostream>
#include <iterator>
#include <system_error>

namespace tool {
namespace {

std::string contents_of(std::istream& in) { return {std::istreambuf_iterator<char>{in}, {}}; }

std::string contents_of_file(const std::string& name) {
    std::ifstream file{name, std::ios::binary};
    // A directory can be opened, but not read.
    if (!file || file.peek() == std::ifstream::traits_type::eof()) {
        if (!file.is_open() || errno == EISDIR) {
            throw usage_error("cannot read " + name + ": " + std::generic_category().message(errno));
        }
        file.clear();
    }
    return contents_of(file);
}

} // namespace

std::string read_body(const std::string& argument) {
    std::string text = argument;
    std::string origin = "the body";
    if (argument == "-") {
        origin = "the body from stdin";
        text = contents_of(std::cin);
    } else if (argument.starts_with('@')) {
        origin = argument.substr(1);
        text = contents_of_file(origin);
    }

    std::string why;
    if (!cles::is_valid_json(text, 32, &why)) {
        throw usage_error(origin + " is not valid JSON: " + why);
    }
    const auto kind = cles::json_reader{text}.peek();
    if (kind != cles::json_reader::kind::object && kind != cles::json_reader::kind::array) {
        throw usage_error(origin + " must be an object or an array, as in {\"value\":1}");
    }
    std::string line;
    cles::append_compact_json(text, line);
    return line;
}

} // namespace tool
