// SPDX-License-Identifier: BSL-1.0
#include "node/session/peer_description.hpp"

#include <cles/json_reader.hpp>
#include <cles/pending.hpp>

#include "json/json_members.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <cstdint>

namespace cles::core {
namespace {

using kind = json_reader::kind;

bool read_name(json_reader& r, std::string& to) {
    std::string_view name;
    if (r.peek() != kind::string) {
        return r.skip();
    }
    if (!r.read(name)) {
        return false;
    }
    if (protocol::is_name(name)) {
        to = name;
    }
    return true;
}

bool read_features(json_reader& r, bool& marks) {
    if (r.peek() != kind::array) {
        return r.skip();
    }
    r.begin_array();
    while (r.next_element()) {
        std::string_view feature;
        if (r.peek() != kind::string) {
            r.skip();
        } else if (r.read(feature)) {
            marks = marks || feature == "mark";
        }
    }
    return r.ok();
}

// A number that is none of bytes says nothing, and leaves the rest readable.
bool read_line_limit(json_reader& r, std::optional<std::size_t>& to) {
    std::string_view text;
    if (!r.read_raw(text)) {
        return false;
    }
    json_reader number{text};
    if (std::uint64_t bytes = 0; number.read(bytes)) {
        to = std::max(static_cast<std::size_t>(bytes), peer_description::least_line);
    }
    return true;
}

bool read_limits(json_reader& r, std::optional<std::size_t>& line) {
    if (r.peek() != kind::object) {
        return r.skip();
    }
    return read_members(r, [&](std::string_view key) { return key == "line" ? read_line_limit(r, line) : r.skip(); });
}

} // namespace

peer_description peer_description::read(std::string_view json) {
    peer_description found;
    json_reader r{json, detail::answer_depth};
    read_members(r, [&](std::string_view key) {
        return key == "node"       ? read_name(r, found.node)
               : key == "features" ? read_features(r, found.marks)
               : key == "limits"   ? read_limits(r, found.line)
                                   : r.skip();
    });
    return found;
}

} // namespace cles::core
