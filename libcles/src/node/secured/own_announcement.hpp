// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/announcement.hpp"
#include "port/group_port.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;
class node_security;

/// Signs it as an update of `path`. What it omits is the same as in the line of an announcement that is not signed.
std::shared_ptr<const signed_announcement> sign_announcement(const announcement& said, std::string_view path,
                                                             std::uint64_t seq, std::string_view epoch,
                                                             const node_security& security);

/// See `security_protocol::endpoints`.
std::vector<std::string> endpoints_of_interfaces(local_node& host, const std::vector<group_port*>& in_group, bool all);

} // namespace cles::core
