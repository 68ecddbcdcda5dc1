// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/session/outbound.hpp"
#include "node/session/request_checks.hpp"
#include "port/request_origin.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

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
    /// It was bound, and the publisher denies it since then. It is tried again, so `on_bound` may follow.
    virtual void on_denied(const protocol::failure&) {}
    /// A new, valid update: its line as received, with the body at the end.
    virtual void on_update(std::string_view line, std::string_view body) = 0;

  protected:
    ~feed_events() = default;
};

struct adverb_list {
    std::string text; ///< in wire format
    std::size_t count = 0;
};

/// The adverbs of a forwarded request, except those that are members of `outgoing_request`: `hops`, `via` with this
/// node's name, the requester, its signature, and those that this version does not know.
adverb_list forwarded_adverbs(const protocol::request_line& request, std::uint8_t hops, std::string_view own_name,
                              const request_origin& by = {});
/// Whether it has some of its own among them. Otherwise they are the same as for an empty request.
bool has_adverbs_to_forward(const protocol::request_line& request) noexcept;
/// The `hops` with which it is forwarded.
std::uint8_t hops_after(const protocol::request_line& request) noexcept;

/// How many adverbs a request has room for when it is forwarded, besides the members of `outgoing_request`: those of
/// `forwarded_adverbs`, and what is added to them.
std::size_t max_further_adverbs(const protocol::request_line& request) noexcept;

/// Permits that one request of a client is sent to another node, and contains what is written for that: `hops`, `via`,
/// `from`. It is made only if `may_pass_on` agrees, and a request of a client is sent only with one. So the right to
/// forward is asked for on every way out of this node. Valid as long as what it is made from.
class forwarding_permit {
  public:
    /// For the request `r`, of that origin, to `node`. Nothing, with the reason, if it may not leave; that is logged.
    static std::optional<forwarding_permit> ask(node_state& n, const protocol::request_line& r,
                                                const request_origin& by, std::string_view node,
                                                protocol::failure& why);
    /// The same for a request of which only this is left. \param adverbs as `forwarded_adverbs` has written them
    static std::optional<forwarding_permit> ask(node_state& n, const request_origin& by, std::string_view node,
                                                verb how, std::string_view path, std::string_view via,
                                                std::string adverbs, protocol::failure& why);

    [[nodiscard]] std::string_view node() const noexcept { return node_; }
    [[nodiscard]] const std::string& adverbs() const noexcept { return adverbs_; }
    /// The nodes that have forwarded it before: it is not sent to them.
    [[nodiscard]] std::string_view via() const noexcept { return via_; }
    /// The member that is stated as the requester. Empty for this node's own clients, and without security.
    [[nodiscard]] std::string_view requester() const noexcept { return requester_; }

  private:
    forwarding_permit(std::string_view node, std::string_view via, std::string_view requester, std::string adverbs)
        : node_(node), via_(via), requester_(requester), adverbs_(std::move(adverbs)) {}

    std::string_view node_;
    std::string_view via_;
    std::string_view requester_;
    std::string adverbs_;
};

/// Sends requests to other nodes: those that a router passes on, and this node's own.
class next_hop {
  public:
    next_hop() = default;
    next_hop(const next_hop&) = delete;
    next_hop& operator=(const next_hop&) = delete;

    /// Passes on a client's request to the node of the permit, and gives it an id. The operation never completes inside
    /// the call. Returns a ticket for `cancel`.
    virtual std::uint64_t forward(const forwarding_permit& permit, const protocol::outgoing_request& r,
                                  time_point deadline, detail::pending_ptr reply,
                                  outbound::progress_function progress) = 0;
    /// The same for a request of this node itself, to the node that its noun names.
    virtual std::uint64_t send_own(const protocol::outgoing_request& r, time_point deadline,
                                   detail::pending_ptr reply) = 0;
    /// Cancels a request in progress: its operation completes with `cancelled`, inside the call.
    virtual void cancel(std::uint64_t ticket) = 0;

    /// Binds a noun of another node for a client, and again whenever the binding is lost, until the result is
    /// destroyed. No event is reported inside the call.
    [[nodiscard]] virtual std::shared_ptr<void> bind(const forwarding_permit& permit, std::string_view path,
                                                     feed_events& to) = 0;

  protected:
    ~next_hop() = default;
};

} // namespace cles::core
