// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/secured/confirmed_epochs.hpp"
#include "node/session/reply_writer.hpp"
#include "protocol/request_line.hpp"

#include <optional>
#include <string>
#include <string_view>

/// Confirmed epochs (docs/protocol_security.md, "Announcements"): an epoch counts only if its node has confirmed it, so
/// that a repeated update of an earlier incarnation is no restart.

namespace cles::core {

class node_security;
struct node_state;

/// The noun that asks that node for its epoch.
std::string epoch_question(std::string_view node, std::string_view challenge);
/// What the reply says; nothing if that node has not signed it for this challenge.
std::optional<confirmed_epoch> read_confirmed_epoch(std::string_view json, std::string_view node,
                                                    std::string_view challenge, const node_security& security);

/// Serves a request for `cles/announced/<challenge>`.
void serve_announced(node_state& host, reply_writer& replies, const protocol::request_line& request);

} // namespace cles::core
