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

/// The noun, as the only argument of the command. `others`: what NODE may be besides a name.
void add_noun(CLI::App& command, std::string& noun, const std::string& others = "self, any or all");

/// -t, --timeout. `default_value` is only for the help.
void add_timeout(CLI::App& command, std::optional<std::chrono::milliseconds>& limit, const std::string& default_value);

/// -n, --count
void add_count(CLI::App& command, std::uint64_t& count, const std::string& help);

/// --hops: how many nodes may forward a request.
void add_hops(CLI::App& command, std::uint32_t& most);

/// An option whose value is a duration; 0 is allowed.
void add_duration(CLI::App& command, const std::string& name, std::chrono::milliseconds& span, const std::string& help);

/// Refuses -d with a reason, for the verbs that take no body.
void refuse_body(CLI::App& command, const std::string& verb);

} // namespace tool
