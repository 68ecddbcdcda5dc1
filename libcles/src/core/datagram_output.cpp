// SPDX-License-Identifier: BSL-1.0
#include "core/datagram_output.hpp"

namespace cles::core {

void datagram_output::append_updates(std::string& out, std::string_view lines) {
    while (!lines.empty()) {
        const auto size = lines.find('\n') + 1; // updates are whole lines
        if (size <= longest_) {
            out.append(lines.substr(0, size));
        } else {
            ++node_.counts.updates_too_large;
        }
        lines.remove_prefix(size);
    }
}

void datagram_output::limit(std::string& out, time_point now) {
    if (stranger_.empty()) {
        return;
    }
    std::size_t kept = 0;
    for (std::size_t at = 0; at < out.size();) {
        const auto size = out.find('\n', at) + 1 - at;
        if (node_.reflection.admit(stranger_, size + headers_, now)) {
            out.replace(kept, size, out, at, size);
            kept += size;
        } else {
            ++node_.counts.datagrams_withheld;
        }
        at += size;
    }
    out.resize(kept);
}

} // namespace cles::core
