// SPDX-License-Identifier: BSL-1.0
#include "daemon/log_format.hpp"

#include <cles/json_writer.hpp>

#include <array>
#include <cstdint>
#include <cstdio>

namespace cles::runtime {
namespace {

void append_printable(std::string& out, std::string_view text) {
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte >= 0x20 && byte != 0x7f) {
            out += c;
        } else if (c == '\n') {
            out += "\\n";
        } else if (c == '\t') {
            out += "\\t";
        } else {
            std::array<char, 8> escape{};
            std::snprintf(escape.data(), escape.size(), "\\x%02x", static_cast<unsigned>(byte));
            out += escape.data();
        }
    }
}

} // namespace

std::string text_of(std::string_view node, const log_entry& entry) {
    std::string out;
    append_printable(out, node);
    if (!entry.peer.empty()) {
        append_printable(out.append(" "), entry.peer);
    }
    if (entry.request != 0) {
        out.append(" id=").append(std::to_string(entry.request));
    }
    append_printable(out.append(": "), entry.text);
    return out;
}

std::string json_of(std::string_view node, const log_entry& entry) {
    std::string out;
    json_writer w{out};
    w.begin_object();
    w.plain_key("node");
    w.value(node);
    if (!entry.peer.empty()) {
        w.plain_key("peer");
        w.value(entry.peer);
    }
    if (entry.request != 0) {
        w.plain_key("id");
        w.value(entry.request);
    }
    w.plain_key("message");
    w.value(entry.text);
    w.end_object();
    return out.substr(1, out.size() - 2);
}

} // namespace cles::runtime
