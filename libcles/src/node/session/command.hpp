// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/pending.hpp>
#include <cles/verb.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// Checks the options of one operation.

namespace cles::core {

/// Which option is invalid, and why; empty if none is.
[[nodiscard]] std::string invalid_option_reason(const call_options& options);
[[nodiscard]] std::string invalid_option_reason(const bind_options& options);

/// The time limit for a given deadline: the verb's default if it is 0, and at most a day.
[[nodiscard]] std::chrono::milliseconds time_limit(std::chrono::milliseconds deadline, verb of);

class local_node;

/// Sends a command such as "PULL car0:localization". One that is malformed, or that cannot be sent as a request, fails
/// with `bad_request`. `left` also limits the time for the reply. Returns a ticket for cancellation; 0 if the operation
/// has completed or its completion is queued.
std::uint64_t send_command(local_node& by, std::string_view command, const call_options& options,
                           detail::pending_ptr operation, std::optional<std::chrono::milliseconds> left = std::nullopt);

} // namespace cles::core
