// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge_connection.hpp"
#include "federation/bridge_link.hpp"
#include "federation/bridge_output.hpp"
#include "federation/bridge_presence.hpp"
#include "federation/bridge_trust.hpp"
#include "federation/inbound_requests.hpp"
#include "federation/outbound_requests.hpp"
#include "federation/pool_table.hpp"
#include "federation/published_nouns.hpp"
#include "federation/received_message.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace cles::bridging {

/// Joins a pool to others through NATS (docs/federation.md): passes each message and each line to the part of it that
/// is concerned. It does no input or output; time is a parameter.
///
/// To the node, it is the other end of links that carry lines. On them, ids are the node's on links to pools, and this
/// object's on the others.
class bridge final {
  public:
    struct settings {
        std::string pool;
        std::string node;
        std::size_t max_line = 1U << 20U;        ///< in bytes, of the node's links
        std::chrono::milliseconds interval{400}; ///< the shortest between heartbeats
    };

    /// \param trust in a secured fleet; else null
    bridge(const settings& setup, bridge_output& out, bridge_trust* trust = nullptr);
    bridge(const bridge&) = delete;
    bridge& operator=(const bridge&) = delete;

    /// Connected to NATS, and not subscribed to anything. \param drawn for the instance \param max_message in bytes
    void on_connected(std::uint64_t drawn, std::size_t max_message, time_point now);
    void on_disconnected(std::string_view why, time_point now);
    void on_message(const received_message& m);
    /// A sealed message could not be opened.
    void on_refused(const received_message& m, std::string_view why) { nats_.drop(m, why); }
    /// A message whose sender may not be alive any more. If it is a request, that is told.
    void on_unproven(const received_message& m) { inbound_.refuse_unproven(m); }
    /// Another bridge does not know this one yet.
    void announce_soon(time_point now) { presence_.announce_soon(now); }
    /// The roster or the rights have changed.
    void on_security_changed(time_point now) { presence_.on_security_changed(now); }
    /// The messages of one read have been passed, and the node has replied to those that it answers at once.
    void on_batch() { inbound_.on_batch(); }
    /// To be called at `due`, and when the node's pool has changed.
    void on_time(time_point now);
    [[nodiscard]] time_point due() const noexcept {
        return is_connected() ? std::min(presence_.due(), drained_by_.value_or(time_point::max())) : time_point::max();
    }
    /// Takes no more requests. Those in flight continue.
    void leave(time_point now);
    /// After `leave`: whether what the server had for this bridge has been received, so that it may end.
    [[nodiscard]] bool has_drained() const noexcept { return leaving_ && (!is_connected() || !drained_by_); }
    /// The node has closed all links: tells the others that this bridge is gone.
    void say_left(time_point now) { presence_.say_left(now); }

    /// A line of the node, without LF.
    void on_line(const bridge_link& from, std::string_view line, time_point now);
    /// The node has closed the link.
    void on_closed(const bridge_link& which);

    /// Which pool has that node: "north" for "north.car1", or for "car1" if that is a node of north. Empty if it is not
    /// known.
    [[nodiscard]] std::string pool_of(std::string_view target, time_point now) const {
        return presence_.pool_of(target, now);
    }
    /// Whether requests can be sent to that pool now.
    [[nodiscard]] bool is_live(std::string_view pool) const { return is_connected() && presence_.is_reachable(pool); }
    /// Whether its last bridge has left in order: requests to it need not wait for another one.
    [[nodiscard]] bool has_left(std::string_view pool) const { return is_connected() && pools().has_left(pool); }
    [[nodiscard]] bool is_connected() const noexcept { return nats_.is_open(); }
    [[nodiscard]] const pool_table& pools() const noexcept { return presence_.pools(); }
    [[nodiscard]] const bridge_figures& counted() const noexcept { return nats_.counts(); }
    /// Members that have sent something, and may not forward for this node.
    [[nodiscard]] const std::set<std::string, std::less<>>& not_permitted() const noexcept {
        return presence_.not_permitted();
    }
    /// How long the last own heartbeat took to the server and back. Nothing if none has come back since the connection
    /// was made: it may not be permitted to publish or receive heartbeats.
    [[nodiscard]] std::optional<time_point::duration> round_trip() const noexcept { return presence_.round_trip(); }
    [[nodiscard]] const bridge_id& self() const noexcept { return nats_.self(); }

  private:
    [[nodiscard]] bool has_effect(const received_message& m);
    void refuse_unreadable(const received_message& m, subject_kind kind, bool is_too_long);
    void on_control(const received_message& m);
    void on_lost(const bridge_id& gone, std::string_view why, time_point now);

    const std::size_t max_line_;
    bridge_output& out_;
    bridge_trust* trust_; // null: the fleet is not secured
    bool leaving_ = false;
    std::optional<time_point> drained_by_; // when it ends in any case, while it waits for what the server has
    bridge_connection nats_;
    bridge_presence presence_;
    outbound_requests outbound_;
    published_nouns published_;
    inbound_requests inbound_;
};

} // namespace cles::bridging
