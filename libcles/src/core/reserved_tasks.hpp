// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/node.hpp"
#include "core/reply_writer.hpp"
#include "protocol/message.hpp"

namespace cles::core {

/// Serves a request for the reserved task `cles`, but for withdrawals (docs/protocol.md, "The reserved task").
void serve_reserved(node& host, reply_writer& replies, const protocol::request_line& request, const identity& peer);

} // namespace cles::core
