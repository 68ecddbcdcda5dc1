// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace cles {

/// Options of one request. Set by chaining: `cles::call_options{}.deadline(200ms).at("tcp://10.0.0.2")`. If a value is
/// out of range, the operation fails with `invalid_option`, and the message names the option.
class call_options {
  public:
    call_options() = default;

    /// How long to wait for the reply; also sent to the peer. 0: the protocol's default (5 s, DELEGATE 30 s). More than
    /// a day counts as a day; negative values are refused.
    call_options& deadline(std::chrono::milliseconds limit);
    /// The URL to send it to, instead of looking up the target's name. `node` is the only node that may answer there,
    /// where the transport can tell: `tls`, `udp` with security, and `unix`; empty: any.
    call_options& at(std::string_view url, std::string_view node = {});
    /// Marks a small request that must not wait behind large ones: it uses a separate link, and its reply is sent
    /// before others that wait at the peer. A peer that does not know the adverb `urgent` sends the reply in the normal
    /// order.
    call_options& urgent(bool value = true);
    /// How many nodes may forward the request: 0 to 16. A node between this one and the target counts as one; if this
    /// node sends it to its own router, that counts too. Larger values are refused.
    call_options& hops(std::uint32_t most);
    /// The member of the fleet for which this node sends the request, if that is another one: the member's rights
    /// count, and this node needs the right to forward for it, as a node that forwards a client's request does
    /// (docs/protocol_security.md, "Forwarded requests"). The way is the same too: other targets than this node itself
    /// need `cles::routing()`, the node counts in `hops`, and what demands the requester's signature is `denied`. So is
    /// any request without security, and of the reserved task all but PULL, because the others concern a link, which
    /// all members share here. Not together with `at`; of bindings, not by multicast.
    call_options& on_behalf_of(std::string_view member);
    /// Makes the request part of a trace: "00-<32 hex digits>-<16 hex digits>-<2 hex digits>" (W3C `traceparent`), such
    /// as `request::trace()` of the request that causes this one. Text of another form is refused. Not for bindings.
    call_options& trace(std::string_view parent);
    /// Receives the peer's error message if the request fails. If it succeeds although a second node has the name of
    /// its target, which gets no requests, it receives a message that says where that node is. It is written before the
    /// request completes, and must outlive the request; if there is nothing to tell, it stays as it is.
    call_options& diagnostics(std::string& text);
    /// Receives the whole failure that the peer has replied, a JSON object (docs/protocol.md, "Replies"), with what
    /// code and message do not tell: `ran`, after which a repeated request repeats its effect, and `retry_ms`. As with
    /// `diagnostics`, it must outlive the request, and stays as it is if there is nothing to tell. Not for bindings.
    call_options& failure(std::string& json);
    /// Called for each progress report of a DELEGATE, with a fraction from 0 to 1 and a JSON object. Runs inline on the
    /// service's executor. Makes the request ask the peer for reports.
    call_options& on_progress(std::function<void(double, std::string_view)> callback);

    std::chrono::milliseconds deadline_{0};
    std::string at_{};
    std::string at_node_{};
    bool urgent_ = false;
    std::uint32_t hops_ = 8;
    bool is_on_behalf_ = false; ///< so that an empty name is refused, and does not mean that there is none
    std::string on_behalf_of_{};
    std::string trace_{};
    std::string* diagnostics_ = nullptr;
    std::string* failure_ = nullptr;
    std::function<void(double, std::string_view)> on_progress_{};
};

/// Options of one binding.
class bind_options : public call_options {
  public:
    bind_options() = default;

    /// The minimum interval between updates; the newest is sent. 0: every update. More than a day counts as a day;
    /// negative values are refused.
    bind_options& every(std::chrono::milliseconds interval) {
        every_ = interval;
        return *this;
    }
    /// How many updates the publisher queues while this subscriber is slow: 1 to 65536; 0: the protocol's default, 64.
    /// Larger values are refused.
    bind_options& keep(std::uint32_t updates);
    /// Binds through the multicast group instead of a link, so that the publisher sends one datagram for all such
    /// subscribers; `all:` does so by default if the service has no routing. `every` and `keep` then have no effect,
    /// and there is no reply: the feed begins with the publisher's last value as an update, and a missing publisher is
    /// not reported.
    bind_options& multicast(bool wanted = true) {
        multicast_ = wanted;
        return *this;
    }
    /// Asks the publisher which update its last value is: `current` events then have `seq` and `epoch`, unless it does
    /// not know. So a reader that was bound before, perhaps by another node, sees whether it has that value already,
    /// and how many updates before it were not received: no `gap` tells of these. Not of bindings of `all:`.
    bind_options& mark(bool wanted = true);
    bind_options& deadline(std::chrono::milliseconds limit);
    bind_options& at(std::string_view url, std::string_view node = {});
    bind_options& hops(std::uint32_t most);
    bind_options& on_behalf_of(std::string_view member);
    bind_options& diagnostics(std::string& text);

    std::chrono::milliseconds every_{0};
    std::uint32_t keep_ = 0;
    bool multicast_ = false;
    bool mark_ = false;
};

} // namespace cles
