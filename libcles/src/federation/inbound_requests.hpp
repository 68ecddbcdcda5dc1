// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge_connection.hpp"
#include "federation/bridge_link.hpp"
#include "federation/bridge_output.hpp"
#include "federation/bridge_trust.hpp"
#include "federation/pool_table.hpp"
#include "federation/published_nouns.hpp"
#include "federation/seen_numbers.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace cles::bridging {

/// The requests of other pools to this one: refuses them, or passes them to the node, and publishes its replies. BIND
/// goes to the bridge of this pool that publishes the noun.
class inbound_requests {
  public:
    /// \param trust in a secured fleet; else null \param published the nouns that this bridge publishes
    /// \param retry the interval of heartbeats: after it, the bridges are known
    inbound_requests(bridge_connection& nats, bridge_output& out, const pool_table& pools, bridge_trust* trust,
                     published_nouns& published, std::string node, std::chrono::milliseconds retry)
        : nats_(nats), out_(out), pools_(pools), trust_(trust), published_(published), node_(std::move(node)),
          retry_(retry) {}

    void on_connected();
    /// Takes no more requests. Those in flight continue.
    void leave();
    /// \param line of the request that the message is \param is_passed_on a BIND that another bridge of this pool took
    void take(const received_message& m, std::string_view line, bool is_passed_on);
    /// A message whose sender may not be alive any more.
    void refuse_unproven(const received_message& m);
    /// A bridge cancels its request of that number. Returns false if there is none.
    bool cancel(const bridge_id& by, std::uint64_t number);
    /// The node has replied to those requests of this read that it answers at once.
    void on_batch();
    /// A reply of the node.
    void on_line(std::string_view line);
    /// The node has closed the link.
    void on_closed(const bridge_link& which);
    void on_lost(const bridge_id& gone, time_point now);
    void on_time(time_point now);
    /// The connection is lost. Nothing is reported.
    void clear();

  private:
    struct request {
        bridge_id by;             ///< without a pool: a program that is no bridge
        std::uint64_t number = 0; ///< by which that bridge knows it
        std::string reply;        ///< the subject for replies; empty: nobody waits
        std::string member;       ///< the name of that bridge, in a secured fleet

        /// The link on which the node has it: one for each pool, in a secured fleet for each of its bridges, and one
        /// for all programs.
        [[nodiscard]] bridge_link on() const {
            return {.what = bridge_link::role::from_pool, .pool = by.pool, .member = member};
        }
    };
    using requests = std::unordered_map<std::uint64_t, request>;

    void bind(const protocol::request_line& r, const request& by, bool is_passed_on);
    [[nodiscard]] std::string requester_of(const protocol::request_line& r, const request& by) const;
    void reply(const std::string& to, std::string_view rest, bool is_interim);
    void cancel(const requests::value_type& which);
    requests::node_type remove(requests::const_iterator which);
    template <class Condition>
    requests take_if(Condition concerns);
    [[nodiscard]] bool remember(const bridge_id& by, time_point now);
    [[nodiscard]] std::optional<protocol::failure> why_not_served(const request& by, bool is_passed_on) const;
    [[nodiscard]] protocol::failure not_known_yet() const;

    bridge_connection& nats_;
    bridge_output& out_;
    const pool_table& pools_;
    bridge_trust* trust_; // null: the fleet is not secured
    published_nouns& published_;
    const std::string node_;
    const std::chrono::milliseconds retry_;
    bool leaving_ = false;
    requests taken_; // until the node answers them, by the id on its link
    std::uint64_t last_id_ = 0;
    std::map<std::pair<bridge_id, std::uint64_t>, std::uint64_t> ids_; // by bridge and number
    std::vector<std::uint64_t> unacknowledged_;
    std::map<bridge_id, seen_numbers> seen_;
    std::map<bridge_id, time_point> not_live_; // that have asked and are not live, and when they are forgotten
};

} // namespace cles::bridging
