// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/identity.hpp>
#include <cles/pending.hpp>
#include <cles/verb.hpp>

#include "node/base/peer_reply.hpp"
#include "node/membership/announcement.hpp"
#include "port/environment.hpp"
#include "port/group_port.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class line_sink;
class local_node;
class outbound;
class reply_writer;
struct node_state;

/// What a subscriber may do with an update (docs/protocol_security.md, "Signed updates").
enum class update_check : std::uint8_t {
    unsigned_one, ///< it need not be signed
    signed_one,   ///< its publisher has signed it
    refused,      ///< it is not signed as its publisher announces
};

/// A request that this node sends.
struct outgoing_call {
    verb how = verb::pull;
    const protocol::noun_view& noun;
    std::string_view body{};
    const call_options& options;
    protocol::carried_adverbs carried{};
    time_point deadline{};
    std::uint64_t ticket = 0; ///< the id of the first attempt
};

/// What secured nodes say on one link besides the plain protocol.
class link_security {
  public:
    link_security() = default;
    link_security(const link_security&) = delete;
    link_security& operator=(const link_security&) = delete;
    virtual ~link_security() = default;

    /// Serves the request if it concerns the link itself. Returns false if it does not.
    virtual bool serve(const protocol::request_line& request, time_point now) = 0;
    /// Whether a bound update is to be delivered now. Others are delivered later, or counted and dropped.
    [[nodiscard]] virtual bool admits(const protocol::request_line& update) = 0;
    /// Asks a publisher whose updates the peer passes on for its epoch, and for what it signs. `then` is called once:
    /// with the answer, or by `due` with the failure if the publisher has not signed one.
    virtual void ask(const std::string& publisher, time_point due, peer_reply::function then) = 0;
    /// States the version of this node's roster.
    virtual void send_hello() = 0;
};

/// What a secured node says, checks and signs besides the plain protocol (docs/protocol_security.md). Programs that do
/// not call `cles::secured` do not link it: the node reaches it only through this interface.
class security_protocol {
  public:
    security_protocol() = default;
    security_protocol(const security_protocol&) = delete;
    security_protocol& operator=(const security_protocol&) = delete;
    virtual ~security_protocol() = default;

    /// Once the node starts. \throws cles::error if the node's name is not that of its key
    virtual void start(local_node& host) = 0;
    /// Before the node ends. Further calls do nothing.
    virtual void stop() noexcept = 0;

    // -- links

    /// What it refers to must outlive it. `deliver` takes the line of an update that `admits` has held back; it is not
    /// called from inside `admits`.
    [[nodiscard]] virtual std::unique_ptr<link_security>
    on_link(const std::shared_ptr<node_state>& host, line_sink& out, outbound& asking, const identity& peer,
            std::function<void(std::string_view line)> deliver) = 0;
    /// A member does not answer by datagram, perhaps because one of both has an old roster.
    virtual void on_unanswered(std::string_view peer) = 0;

    // -- requests of this node

    /// The operation for a request's first attempt, which completes `operation`, now or after the second attempt.
    [[nodiscard]] virtual detail::pending_ptr watch(const outgoing_call& request, detail::pending_ptr operation) = 0;
    /// Cancels the second attempt of a request. Returns false if there is none.
    virtual bool cancel(std::uint64_t ticket) = 0;

    // -- requests of others

    /// Why a request for a signed task may not run. Nothing if it may run, once: then `due` becomes the time until
    /// which its requester has signed to wait, if that is earlier. `link` is the identity of the peer, of which each
    /// link has its own.
    [[nodiscard]] virtual std::optional<protocol::failure>
    refusal(const identity& link, const protocol::request_line& request, time_point& due, time_point now) = 0;
    /// The link is gone.
    virtual void forget(const identity& link) noexcept = 0;
    /// Serves a request for the reserved task `cles`. Returns false if only the plain protocol may have it.
    virtual bool serve_reserved(reply_writer& replies, const protocol::request_line& request) = 0;

    // -- updates of others

    /// Whether updates of that task must be signed; nothing if the publisher's announcement is not known.
    [[nodiscard]] virtual std::optional<bool> must_be_signed(std::string_view publisher,
                                                             std::string_view task) const = 0;
    /// \param direct whether its publisher itself has sent it on a link; otherwise the publisher's announcement must be
    /// known
    [[nodiscard]] virtual update_check check(const protocol::request_line& update, bool direct) const = 0;

    // -- announcements

    /// Signs the announcement of this node, with the next `seq`, if there is something new in it; otherwise completes
    /// it with the last one that was signed. Returns the line for the group: the announcement, or only its load.
    [[nodiscard]] virtual std::string announce(announcement& said, std::uint64_t& seq, bool in_group,
                                               bool by_gossip) = 0;
    /// A node looks for this one.
    virtual void on_solicited() = 0;
    /// A member has reported its load in the group. Returns false if the report is malformed.
    virtual bool on_load_report(const group_source& from, const protocol::request_line& report, time_point now) = 0;
    /// The endpoints to announce: the same for all receivers, since they are signed. With the addresses of the
    /// interfaces instead of an unspecified one, and without Unix sockets, which mean nothing to other hosts.
    /// \param all whether others reach this node by all of its interfaces, not only by those in the group
    [[nodiscard]] virtual std::vector<std::string> endpoints(const std::vector<group_port*>& in_group, bool all) = 0;
    /// A member has announced that its roster has this version.
    virtual void on_stated_roster(std::string_view node, std::uint32_t version, time_point now) = 0;
};

} // namespace cles::core
