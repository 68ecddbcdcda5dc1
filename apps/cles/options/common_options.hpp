// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace tool {

/// The noun, as the command's one argument.
void add_noun(CLI::App& command, std::string& noun);

/// -t, --timeout. `otherwise` is what the help says of the default.
void add_timeout(CLI::App& command, std::optional<std::chrono::milliseconds>& limit, const std::string& otherwise);

/// -n, --count: how often, or how many.
void add_count(CLI::App& command, std::uint64_t& count, const std::string& help);

/// An option whose value is a time, 0 included.
void add_duration(CLI::App& command, const std::string& name, std::chrono::milliseconds& span, const std::string& help);

/// Refuses -d with a reason, for the verbs that take no body.
void refuse_body(CLI::App& command, const std::string& verb);

} // namespace tool
