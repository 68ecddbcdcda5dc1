// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/result_text.hpp"
#include "protocol/reply_line.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles::core {

/// Appends an interim reply and its LF. One that is longer than a line may be goes without its details: the peer would
/// close the link over it, or it does not fit.
inline void append_progress_line(std::string& out, std::uint64_t id, double fraction, std::string_view json,
                                 std::size_t longest) {
    const auto line = out.size();
    protocol::append_progress_head(out, id, fraction);
    const auto body = out.size();
    out.append(json);
    close_result(out, body);
    if (out.size() - line > longest) {
        out.replace(body, out.size() - body, "{}");
    }
    out.push_back('\n');
}

} // namespace cles::core
