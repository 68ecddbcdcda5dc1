// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/session/reply_writer.hpp"

#include <string>

namespace cles::detail {

/// What tells the types of a node's tasks (docs/protocol.md, "Types"). Functions, so that a program that does not tell
/// them does not link these.
struct types_part {
    /// Changes with everything that is told; for the reply to `PULL self:cles`.
    std::string (*digest)(const core::node_state& n);
    /// Serves a PULL of the reserved task; false if it is for something else.
    bool (*serve)(core::node_state& host, core::reply_writer& replies, const protocol::request_line& request,
                  const identity& peer);
};

} // namespace cles::detail
