// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/session/outbound.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

/// Receives the events of a noun that is bound at another node.
class feed_events {
  public:
    feed_events() = default;
    feed_events(const feed_events&) = delete;
    feed_events& operator=(const feed_events&) = delete;
    /// The noun is bound, for the first time or again, with its last value or {}.
    virtual void on_bound(std::string_view last) = 0;
    /// The first BIND was refused. It is not repeated, and no event follows.
    virtual void on_refused(const protocol::failure& why) = 0;
    /// A new, valid update: its line as received, with the body at the end.
    virtual void on_update(std::string_view line, std::string_view body) = 0;

  protected:
    ~feed_events() = default;
};

/// Sends the requests of a router to other nodes.
class next_hop {
  public:
    next_hop() = default;
    next_hop(const next_hop&) = delete;
    next_hop& operator=(const next_hop&) = delete;

    /// Sends a request to the node that its noun names, and gives it an id. The operation never completes inside the
    /// call. Returns a ticket for `cancel`.
    /// `via`: the nodes that have forwarded the request before; it is not sent to them.
    virtual std::uint64_t send(const protocol::outgoing_request& r, time_point deadline, detail::pending_ptr reply,
                               outbound::progress_function progress, std::string_view via) = 0;
    /// Cancels a request in progress: its operation completes with `cancelled`, inside the call.
    virtual void cancel(std::uint64_t ticket) = 0;

    /// Binds a noun of another node, and again whenever the binding is lost, until the result is destroyed. No event is
    /// reported inside the call.
    [[nodiscard]] virtual std::shared_ptr<void> bind(std::string_view node, std::string_view path,
                                                     std::string_view adverbs, feed_events& to) = 0;

  protected:
    ~next_hop() = default;
};

struct adverb_list {
    std::string text; ///< in wire format
    std::size_t count = 0;
};

/// The adverbs of a forwarded request, except those that are members of `outgoing_request`: `hops`, `via` with this
/// node's name, the requester, its signature, and those that this version does not know.
adverb_list forwarded_adverbs(const protocol::request_line& request, std::uint8_t hops, std::string_view own_name,
                              std::string_view requester = {});
/// Whether it has some of its own among them. Otherwise they are the same as for an empty request.
bool has_adverbs_to_forward(const protocol::request_line& request) noexcept;
/// The `hops` with which it is forwarded.
std::uint8_t hops_after(const protocol::request_line& request) noexcept;

/// How many adverbs a request has room for when it is forwarded, besides the members of `outgoing_request`: those of
/// `forwarded_adverbs`, and what is added to them.
std::size_t max_further_adverbs(const protocol::request_line& request) noexcept;

} // namespace cles::core
