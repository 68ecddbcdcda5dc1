// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

enum class verdict : std::uint8_t { ok, warning, failure };

/// "ok", "warning", "failure"
std::string_view to_string(verdict how);

/// What `cles doctor` found out about one thing.
struct finding {
    std::string_view check; ///< what was looked at: "ports"
    verdict how = verdict::ok;
    std::string text;
    std::string advice{}; ///< what to do about it
};

using findings = std::vector<finding>;

bool has_failure(const findings& all);
std::string to_text(const findings& all);
std::string to_json(const findings& all);

} // namespace tool
