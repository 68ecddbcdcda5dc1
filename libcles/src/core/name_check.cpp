// SPDX-License-Identifier: BSL-1.0
#include "core/name_check.hpp"

#include "core/json_members.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <limits>

namespace cles::core {

probe_outcome read_probe_answer(std::string_view json) {
    constexpr auto longest = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max() / 1'000'000);
    probe_outcome found;
    bool has_epoch = false;
    json_reader r{json};
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "node") {
            return r.read(found.node);
        }
        if (key == "epoch") {
            std::string text;
            if (!r.read(text)) {
                return false;
            }
            const auto epoch = protocol::parse_epoch(text);
            has_epoch = epoch.has_value();
            found.epoch = epoch.value_or(0);
            return true;
        }
        if (key == "uptime_ms") {
            std::uint64_t ms = 0;
            if (!r.read(ms)) {
                return false;
            }
            found.uptime = std::chrono::milliseconds{std::min(ms, longest)};
            return true;
        }
        return r.skip();
    });
    if (good && has_epoch && !found.node.empty()) {
        found.what = probe_outcome::kind::answered;
    }
    return found;
}

} // namespace cles::core
