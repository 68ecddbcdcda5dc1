// SPDX-License-Identifier: BSL-1.0

#include "protocol/datagram.hpp"

#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"

namespace cles::protocol {

bool parse_group_message(std::string_view datagram, request_line& out) {
    if (datagram.size() > datagram_bytes) {
        return false;
    }
    if (datagram.ends_with('\n')) {
        datagram.remove_suffix(1);
    }
    const auto line = trim(datagram);
    if (line.empty() || has_many_lines(line) || is_reply(line)) {
        return false;
    }
    malformed_request ignored;
    return parse_request(line, out, ignored);
}

} // namespace cles::protocol
