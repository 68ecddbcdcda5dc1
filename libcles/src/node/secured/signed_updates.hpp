// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/security_protocol.hpp"
#include "protocol/request_line.hpp"

#include <optional>
#include <string_view>

namespace cles::core {

class confirmed_epochs;
struct node_state;

/// Whether updates of that task must be signed; nothing if neither the publisher's announcement is known, nor what it
/// has confirmed.
[[nodiscard]] std::optional<bool> must_be_signed(const node_state& n, const confirmed_epochs& confirmed,
                                                 std::string_view publisher, std::string_view task);

/// \param direct whether its publisher itself has sent it on a link; otherwise it must be known whether the update must
/// be signed \pre the node is secured
[[nodiscard]] update_check check_signature(const node_state& n, const confirmed_epochs& confirmed,
                                           const protocol::request_line& update, bool direct);

} // namespace cles::core
