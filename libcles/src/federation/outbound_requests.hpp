// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge_connection.hpp"
#include "federation/bridge_link.hpp"
#include "federation/bridge_output.hpp"
#include "federation/foreign_feeds.hpp"
#include "federation/pool_table.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace cles::bridging {

/// The requests of this node to other pools, on its links to them: publishes them, and passes the answers to the node.
class outbound_requests {
  public:
    /// \param is_secured each request is sent to one bridge that is known; else NATS selects one
    outbound_requests(bridge_connection& nats, bridge_output& out, const pool_table& pools, bool is_secured)
        : nats_(nats), out_(out), pools_(pools), is_secured_(is_secured), feeds_(nats, out) {}

    /// A line of the node.
    void on_line(const bridge_link& from, std::string_view line, time_point now);
    /// The node has closed the link: nobody waits.
    void on_closed(const bridge_link& which);
    void on_reply(const received_message& m);
    /// A reply that cannot be passed on: the request fails.
    void on_unusable_reply(const received_message& m, const protocol::failure& why);
    void on_update(const received_message& m) { feeds_.on_update(m.about, m.text); }
    /// That bridge has ended what it had bound because of this bridge's request of that number.
    void on_unbound(const bridge_id& by, std::uint64_t number) { feeds_.on_unbound(by, number); }
    void on_time(time_point now);
    /// What that bridge took, or was sent alone, is not answered any more.
    void on_lost(const bridge_id& gone, std::string_view why);
    /// The pool has no bridge any more: its links are lost.
    void lose_pool(std::string_view pool);
    /// The connection is lost. Nothing is reported.
    void clear();

  private:
    struct request {
        bridge_link from;
        std::uint64_t id = 0;
        std::uint64_t number = 0;
        std::string addressee{}; ///< the bridge to which it was sent; empty: the one that NATS has selected
        time_point sent_at;
        time_point forgotten_at; ///< for lack of a reply
        std::string taker{};     ///< the bridge that has acknowledged it; empty: none yet
        bool is_cancelled = false;
    };
    using requests = std::unordered_map<std::uint64_t, request>;

    void publish(const bridge_link& from, const protocol::request_line& r, time_point now);
    void bind(const bridge_link& from, const protocol::request_line& r, time_point now);
    void answer_for_itself(const bridge_link& from, const protocol::request_line& r);
    void refuse(const bridge_link& on, std::uint64_t id, const protocol::failure& why);
    void on_taken(std::uint64_t number, std::string_view taker, time_point now);
    void note_round_trip(const std::string& pool, time_point::duration took);
    [[nodiscard]] std::uint32_t deadline_of_all(std::string_view pool, std::uint32_t left_ms) const;
    void answer(const request& answered, std::string_view reply);
    void fail(requests::iterator which, const protocol::failure& why);
    void fail_unacknowledged(requests::iterator which, std::string why);
    void cancel(requests::iterator which);
    void cancel_at_taker(requests::const_iterator which);
    void forget_id(requests::const_iterator of);
    request take(requests::iterator which);
    template <class Condition>
    [[nodiscard]] std::vector<requests::iterator> find_if(Condition concerns);

    bridge_connection& nats_;
    bridge_output& out_;
    const pool_table& pools_;
    const bool is_secured_;
    foreign_feeds feeds_;
    requests sent_; // by the number by which pools answer
    std::uint64_t last_number_ = 0;
    std::unordered_map<std::uint64_t, std::uint64_t> numbers_;             // by the node's id; not of cancelled ones
    std::map<std::string, time_point::duration, std::less<>> round_trips_; // by pool
    std::uint32_t turn_ = 0; // of the bridges of a pool that take requests
};

} // namespace cles::bridging
