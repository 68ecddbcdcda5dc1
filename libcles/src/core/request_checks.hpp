// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/node.hpp"
#include "protocol/message.hpp"

#include <boost/container/static_vector.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// What has to be known of a request before it is served.

namespace cles::core {

using decoded_parameters = boost::container::static_vector<std::string_view, protocol::max_parameters>;

/// The parameters decoded: what holds escapes into `storage`, the others as views of the line.
decoded_parameters decode(const protocol::noun_view& noun, std::string& storage);

/// Gives back the memory of the text that a link reuses for each request's noun, where one has been unusually long.
void release_if_large(std::string& decoded);

/// Whether `name` is in a comma-separated list.
bool passes(std::string_view via, std::string_view name);

/// Whether the access rules let this peer ask for this.
bool allows(const node& n, const identity& peer, const protocol::request_line& request);

/// Whether it is for this node by name or as `self`.
bool is_for(const node& n, const protocol::request_line& request);

/// What keeps a node from serving a request, whatever it asks for: access, target, body.
std::optional<protocol::failure> objection(const node& n, const identity& peer, const protocol::request_line& request);

/// Whether it says that the peer leaves: what it has not answered by then, it has not begun (docs/protocol.md,
/// "Leaving").
bool says_that_it_leaves(const protocol::request_line& request) noexcept;

/// What a node that leaves answers to what it does not begin any more.
protocol::failure shutting_down(const node& n);

/// What a link is told that comes past the limit.
protocol::failure no_room_for_links(const node& n);

/// The id in "cles/cancel/<id>"; nothing for other nouns and for what is no id.
std::optional<std::uint64_t> cancelled_id(const protocol::noun_view& noun);

} // namespace cles::core
