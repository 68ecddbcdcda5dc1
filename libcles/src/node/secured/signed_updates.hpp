// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/security_protocol.hpp"
#include "protocol/request_line.hpp"

#include <optional>
#include <string_view>

namespace cles::core {

struct node_state;

/// Whether updates of that task must be signed; nothing if the publisher's announcement is not known.
[[nodiscard]] std::optional<bool> must_be_signed(const node_state& n, std::string_view publisher,
                                                 std::string_view task);

/// \param direct whether its publisher itself has sent it on a link; otherwise the publisher's announcement must be
/// known \pre the node is secured
[[nodiscard]] update_check check_signature(const node_state& n, const protocol::request_line& update, bool direct);

} // namespace cles::core
