// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/pending.hpp>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

namespace cles::shell {

class local_node;

/// Sends a command of the language: "PULL car0:localization". One that is malformed, or that cannot be sent as a
/// request, fails with `bad_request`. Where `left` is given, the answer has at most that long. Returns a ticket by
/// which it can be withdrawn; 0 where it has been completed or queued for it.
std::uint64_t send_command(local_node& by, std::string_view command, const call_options& options,
                           detail::pending_ptr operation, std::optional<std::chrono::milliseconds> left = std::nullopt);

} // namespace cles::shell
