// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/verb.hpp>

#include "port/environment.hpp"
#include "port/group_port.hpp"
#include "port/message_seal.hpp"
#include "port/request_origin.hpp"
#include "protocol/grammar.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// What a node learns from its security.
class security_observer {
  public:
    security_observer() = default;
    security_observer(const security_observer&) = delete;
    security_observer& operator=(const security_observer&) = delete;

    /// The roster or the rules have changed. May be called from inside a function of `node_security`, but not from one
    /// that is const.
    virtual void on_security_changed() = 0;
    /// A member has stated this version of the roster in a session.
    virtual void on_stated_roster(std::string_view name, std::uint32_t version) = 0;
    /// A member that sends to the group did not answer by datagram. One of the endpoints that it announces may be
    /// tried, so that both have the newer roster.
    virtual void on_unanswered(std::string_view name, const std::vector<std::string>& endpoints) = 0;
    /// `node_security::on_time` is to be called at that time instead of a later one.
    virtual void on_due(time_point at) = 0;
    virtual void on_security_log(log_level level, std::string text) = 0;

  protected:
    ~security_observer() = default;
};

/// What a secured node asks of its environment about its fleet (docs/protocol_security.md): who is a member, what
/// members may do, and the roster. Nodes without security have none, so that they do not contain the code.
///
/// Names are those of members. The functions are called on the node's executor.
class node_security {
  public:
    node_security() = default;
    node_security(const node_security&) = delete;
    node_security& operator=(const node_security&) = delete;
    virtual ~node_security() = default;

    /// Called once, before all others. The clock must outlive this, the observer live until `end`.
    /// \throws cles::error if the node's name is not that of its key
    virtual void begin(std::string_view name, std::uint32_t epoch, const clock& time, security_observer& observer) = 0;
    /// Nothing is reported any more.
    virtual void end() = 0;
    virtual void on_time(time_point now) = 0;

    [[nodiscard]] virtual bool is_member(std::string_view name) const = 0;
    /// Whether the requester may send this request to `provider`, and its forwarder may pass it on. For an update,
    /// `how` is BIND. This node may ask everything of itself, unless somebody states it as the requester: then it has
    /// the rights in the roster.
    [[nodiscard]] virtual bool allows(const request_origin& by, std::string_view provider, verb how,
                                      const protocol::noun_view& noun) const = 0;
    /// Whether `forwarder` may pass on requests of `requester`. Each member may state its own name.
    [[nodiscard]] virtual bool may_forward(std::string_view forwarder, std::string_view requester) const = 0;

    /// The signature of an update of this node, for the adverb `sig`.
    [[nodiscard]] virtual std::string sign_update(std::string_view path, std::uint64_t seq, std::string_view epoch,
                                                  std::string_view body) const = 0;
    [[nodiscard]] virtual bool is_signed(std::string_view publisher, std::string_view path, std::uint64_t seq,
                                         std::string_view epoch, std::string_view body, std::string_view sig) const = 0;
    /// A challenge for a requester to sign.
    [[nodiscard]] virtual std::string new_challenge() const = 0;
    /// The signature of a request of this node, executed by `node`, for which it waits as long as stated. Empty if that
    /// is not a challenge that nodes write.
    [[nodiscard]] virtual std::string sign_request(std::string_view node, std::string_view challenge, verb how,
                                                   std::string_view path, std::string_view body,
                                                   std::uint32_t waits_ms) const = 0;
    /// Whether `sig` is the signature of a request that this node executes, with the time that it states.
    [[nodiscard]] virtual bool is_request_signed(std::string_view requester, std::string_view challenge, verb how,
                                                 std::string_view path, std::string_view body,
                                                 const protocol::request_signature& sig) const = 0;
    /// A port that seals what it sends with that one, and delivers what it can open, with its sender.
    [[nodiscard]] virtual std::shared_ptr<group_port> seal(std::shared_ptr<group_port> port) = 0;

    /// For a new connection to NATS. This must outlive it.
    [[nodiscard]] virtual std::unique_ptr<message_seal> seal_messages() = 0;

    /// Datagrams that were dropped because they were not sealed.
    [[nodiscard]] virtual std::uint64_t unsealed_datagrams() const { return 0; }
    /// Sealed datagrams of the group that could not be opened.
    [[nodiscard]] virtual std::uint64_t unopened_group_datagrams() const { return 0; }

    /// The version of the roster in force.
    [[nodiscard]] virtual std::uint32_t roster_version() const = 0;
    /// Its line, without LF.
    [[nodiscard]] virtual const std::string& roster_line() const = 0;
    /// Takes a roster from a peer. Returns what is wrong with it; nothing if it is in force now, or is not newer.
    virtual std::optional<std::string> offer_roster(std::string_view line) = 0;
    /// Whether to ask a member that states this version for its roster now; notes that it was asked.
    virtual bool wants_roster(std::string_view from, std::uint32_t version, time_point now) = 0;
};

} // namespace cles::core
