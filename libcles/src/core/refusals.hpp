// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/node.hpp"
#include "protocol/message.hpp"

#include <cstddef>
#include <optional>
#include <string>

/// What requests are refused with.

namespace cles::core {

protocol::failure busy(std::string message);
/// The node holds as much for its peers as it may, or this peer more than is left for others.
protocol::failure no_memory(const node& n);
protocol::failure no_such_task(const node& n, const protocol::request_line& request);
/// A line over the limit; `datagram`: bytes of one, 0 on a stream.
protocol::failure overlong(const node& n, std::size_t datagram);
/// That it runs as many handlers as it may; nothing where it does not.
std::optional<protocol::failure> no_room_to_run(const node& n);
/// A failure once the handler has begun: a requester that repeats it has to know.
protocol::failure after_run(protocol::failure why);

std::string failure_text(const protocol::failure& why);

} // namespace cles::core
