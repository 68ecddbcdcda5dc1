// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge_connection.hpp"
#include "federation/bridge_output.hpp"
#include "federation/bridge_trust.hpp"
#include "federation/heartbeat.hpp"
#include "federation/pool_table.hpp"

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace cles::bridging {

/// Which bridges and pools there are: tells the other bridges by heartbeats that this one lives, learns from theirs
/// which live and which are lost, and exchanges the names of the pools' nodes with them.
class bridge_presence {
  public:
    using loss_handler = std::function<void(const bridge_id& gone, std::string_view why, time_point now)>;

    /// \param interval the shortest between heartbeats \param trust in a secured fleet; else null
    /// \param on_lost called when what has to do with that bridge is over
    bridge_presence(bridge_connection& nats, bridge_output& out, bridge_trust* trust, std::string node,
                    std::chrono::milliseconds interval, loss_handler on_lost)
        : nats_(nats), out_(out), trust_(trust), node_(std::move(node)), shortest_(interval),
          on_lost_(std::move(on_lost)) {}

    /// \param before the instance that this bridge was; empty: none
    void on_connected(std::string before, time_point now);
    void on_disconnected(time_point now);
    /// In a secured fleet, others select no bridge that takes no more requests.
    void leave(time_point now);
    void say_left(time_point now);
    void on_time(time_point now);
    [[nodiscard]] time_point due() const noexcept;
    /// Another bridge does not know this one yet.
    void announce_soon(time_point now);
    void on_security_changed(time_point now);

    void on_heartbeat(const received_message& m);
    void on_names(const received_message& m);
    /// Another bridge asks for the names.
    void on_asked_for_names(time_point now);
    /// That bridge had taken this one for lost. It continues, but has forgotten what it had to do with this one.
    void on_forgotten_by(const bridge_id& by, time_point now);

    [[nodiscard]] const pool_table& pools() const noexcept { return pools_; }
    [[nodiscard]] std::string pool_of(std::string_view target, time_point now) const;
    /// Whether requests can be sent to that pool now.
    [[nodiscard]] bool is_reachable(std::string_view pool) const { return !reachable_from_ && pools_.is_live(pool); }
    /// Returns whether the member that has sent a message may forward for this node; if not, counts and logs that.
    [[nodiscard]] bool admit(const message_sender& by);
    [[nodiscard]] const std::set<std::string, std::less<>>& not_permitted() const noexcept { return untrusted_; }
    [[nodiscard]] std::optional<time_point::duration> round_trip() const noexcept { return round_trip_; }

  private:
    void send_heartbeat(bool starting, time_point now);
    void send_names(time_point now);
    [[nodiscard]] bool is_of_sender(const heartbeat& said, const bridge_id& id, const message_sender& by) const;
    void remove(const bridge_id& gone, std::string_view why, time_point now);
    void lose(const bridge_id& gone, std::string_view why, time_point now);
    void ask_for_names(const bridge_id& of, time_point now);
    void check_own_pool(time_point now);
    [[nodiscard]] std::chrono::milliseconds interval() const;

    bridge_connection& nats_;
    bridge_output& out_;
    bridge_trust* trust_; // null: the fleet is not secured
    const std::string node_;
    const std::chrono::milliseconds shortest_;
    const loss_handler on_lost_;
    pool_table pools_;
    node_names home_;
    std::string replaced_;                     // the instance before
    std::optional<time_point> starting_until_; // in a secured fleet: others get to know this bridge
    std::optional<time_point> reachable_from_; // other pools, which know it then
    bool closing_ = false;
    bool left_ = false;
    time_point connected_at_{};
    bool pools_may_appear_ = false; // names with their prefix are taken for theirs
    time_point next_heartbeat_{};
    time_point last_heartbeat_{};
    std::optional<time_point> heartbeat_sent_; // nothing: it has come back
    std::optional<time_point::duration> round_trip_;
    time_point next_names_{};
    bool names_wanted_ = false;
    std::map<bridge_id, time_point> asked_names_;  // and when
    std::set<std::string> warned_of_;              // bridges of the own pool that are not at home, and were logged
    std::set<std::string, std::less<>> untrusted_; // members that may not forward, and were logged
};

} // namespace cles::bridging
