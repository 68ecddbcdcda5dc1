// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/log.hpp>

#include "federation/bridge_link.hpp"
#include "federation/foreign_feeds.hpp"
#include "federation/heartbeat.hpp"
#include "federation/pool_table.hpp"
#include "federation/published_nouns.hpp"
#include "federation/sent_requests.hpp"
#include "federation/subject.hpp"
#include "federation/taken_requests.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// What a bridge does outside itself. None of it calls the bridge.
class bridge_output {
  public:
    bridge_output() = default;
    bridge_output(const bridge_output&) = delete;
    bridge_output& operator=(const bridge_output&) = delete;

    enum class room : std::uint8_t {
        shared,  ///< of requests, replies and updates
        reserved ///< for short messages without which others would wait in vain: failures, control, heartbeats
    };
    /// Returns false if too much waits already.
    virtual bool publish(std::string subject, std::string reply, std::string message, room in) = 0;
    /// \param shared one bridge of the pool receives each message
    virtual void subscribe(std::string subject, bool shared) = 0;
    virtual void unsubscribe(const std::string& subject) = 0;

    /// A line for the node, without LF. Opens the link if it is not `to_pool` and not open.
    virtual void deliver(const bridge_link& on, std::string line) = 0;
    /// The links to and from that pool are lost.
    virtual void lose_pool(std::string_view pool, std::string_view why) = 0;
    virtual void lose_all(std::string_view why) = 0;
    /// The binding of that noun on the link is lost.
    virtual void lose_binding(const bridge_link& on, const std::string& noun, std::string_view why) = 0;
    /// There are other pools, or other nodes in them.
    virtual void on_pools_changed() = 0;

    /// The names of the nodes of the own pool, this one included.
    [[nodiscard]] virtual std::vector<std::string> home_names() const = 0;
    virtual void log(log_level level, const std::string& text) = 0;

  protected:
    ~bridge_output() = default;
};

/// What the bridge of a secured fleet asks about members. None of it calls the bridge.
class bridge_trust {
  public:
    bridge_trust() = default;
    bridge_trust(const bridge_trust&) = delete;
    bridge_trust& operator=(const bridge_trust&) = delete;

    /// Whether that member may forward for this node: others are no bridges to it.
    [[nodiscard]] virtual bool may_forward(std::string_view member) const = 0;
    /// How to permit it, for people.
    [[nodiscard]] virtual std::string how_to_permit(std::string_view member) const = 0;
    /// Why a BIND that this member has sent is refused. Nothing: it is permitted.
    [[nodiscard]] virtual std::optional<protocol::failure> refusal(std::string_view member,
                                                                   const protocol::request_line& bind) const = 0;
    [[nodiscard]] virtual std::uint32_t roster_version() const = 0;
    /// That bridge is lost. What it has sent before does not count any more.
    virtual void on_lost(const bridge_id& gone) = 0;
    /// A bridge has stated the version of its roster.
    virtual void on_stated_roster(const bridge_id& by, std::uint32_t version) = 0;

  protected:
    ~bridge_trust() = default;
};

/// The bridge that has sealed a message; empty in a fleet without security.
struct message_sender {
    std::string_view member{};
    std::string_view instance{};
};

/// Joins a pool to others through NATS: passes requests of the node to other pools, and theirs to the node
/// (docs/federation.md). It does no input or output; time is a parameter.
///
/// To the node, it is the other end of links that carry lines. On them, ids are the node's on links to pools, and this
/// object's on the others.
class bridge final : private sent_requests_events {
  public:
    struct settings {
        std::string pool;
        std::string node;
        std::size_t max_line = 1U << 20U;        ///< in bytes, of the node's links
        std::chrono::milliseconds interval{400}; ///< the shortest between heartbeats
    };
    struct figures {
        std::uint64_t requests_sent = 0;
        std::uint64_t requests_taken = 0;
        std::uint64_t updates_sent = 0;
        std::uint64_t updates_received = 0;
        std::uint64_t updates_dropped = 0;  ///< not sent: too long, or too much waits already
        std::uint64_t messages_refused = 0; ///< not of this protocol, or repeated
        std::uint64_t bridges_lost = 0;
        std::uint64_t connections = 0;
    };

    /// \param trust in a secured fleet; else null
    bridge(settings setup, bridge_output& out, bridge_trust* trust = nullptr)
        : setup_(std::move(setup)), out_(out), trust_(trust), sent_(*this) {}

    /// Connected to NATS, and not subscribed to anything. \param drawn for the instance \param max_message in bytes
    void on_connected(std::uint64_t drawn, std::size_t max_message, time_point now);
    void on_disconnected(std::string_view why);
    void on_message(std::string_view where, std::string_view reply, std::string_view message, time_point now,
                    const message_sender& by = {});
    /// A sealed message could not be opened.
    void on_refused(std::string_view where, std::string_view why, time_point now);
    /// A message whose sender may not be alive any more. If it is a request, that is told.
    void on_unproven(std::string_view where, std::string_view reply, time_point now);
    /// Another bridge does not know this one yet.
    void announce_soon(time_point now);
    /// The roster or the rights have changed.
    void on_security_changed(time_point now);
    /// The messages of one read have been passed, and the node has replied to those that it answers at once.
    void on_batch();
    /// To be called at `due`, and when the node's pool has changed.
    void on_time(time_point now);
    [[nodiscard]] time_point due() const noexcept { return due_; }
    /// Takes no more requests. Those in flight continue.
    void leave(time_point now);
    /// The node has closed all links: tells the others that this bridge is gone.
    void say_left();

    /// A line of the node, without LF.
    void on_line(const bridge_link& from, std::string_view line, time_point now);
    /// The node has closed the link.
    void on_closed(const bridge_link& which);

    /// Which pool has that node: "north" for "north.car1", or for "car1" if that is a node of north. Empty if it is not
    /// known.
    [[nodiscard]] std::string pool_of(std::string_view target, time_point now) const;
    /// Whether requests can be sent to that pool now.
    [[nodiscard]] bool is_live(std::string_view pool) const {
        return connected_ && !reachable_from_ && pools_.is_live(pool);
    }
    [[nodiscard]] bool is_connected() const noexcept { return connected_; }
    [[nodiscard]] const pool_table& pools() const noexcept { return pools_; }
    [[nodiscard]] const figures& counted() const noexcept { return figures_; }
    /// Members that have sent something, and may not forward for this node.
    [[nodiscard]] const std::set<std::string, std::less<>>& not_permitted() const noexcept { return untrusted_; }
    /// How long the last own heartbeat took to the server and back. Nothing if none has come back since the connection
    /// was made: it may not be permitted to publish or receive heartbeats.
    [[nodiscard]] std::optional<time_point::duration> round_trip() const noexcept { return round_trip_; }
    [[nodiscard]] const bridge_id& self() const noexcept { return self_; }

  private:
    // Requests of the node.
    void send_request(const bridge_link& from, std::string_view line, time_point now);
    void send_bind(const bridge_link& from, const protocol::request_line& r, time_point now);
    void publish_request(const bridge_link& from, const protocol::request_line& r, time_point now);
    void end_bindings(const std::vector<foreign_feeds::removed>& ended);
    void end_binding_at(const std::string& taker, const foreign_noun& noun);
    void answer(const bridge_link& on, std::uint64_t id, std::string_view reply);
    void refuse(const bridge_link& on, std::uint64_t id, const protocol::failure& why);
    void answer_for_itself(const bridge_link& from, const protocol::request_line& r);
    void deliver(std::vector<foreign_feeds::update> updates);
    void unsubscribe_if_last(const foreign_feeds::removed& gone);

    // Requests of other pools.
    void take(std::string_view where, std::string_view line, std::string_view reply, std::string_view member,
              bool is_passed_on);
    void take_bind(const protocol::request_line& r, const taken_requests::request& by, bool is_passed_on);
    void send_reply(std::string_view line);
    void send_bind_reply(std::string_view line);
    void send_update(std::string_view line);
    void cancel_taken(std::uint64_t id);
    void end_published(const std::string& noun);
    bool publish(std::string subject, std::string message);
    void publish_short(std::string subject, std::string message);
    void refuse_foreign(const std::string& reply, const protocol::failure& why);
    void drop(std::string_view where, std::string_view why);
    bool remember(const bridge_id& by);
    [[nodiscard]] std::optional<protocol::failure> why_not_served(const taken_requests::request& by,
                                                                  bool is_passed_on) const;

    // Other bridges.
    void on_heartbeat(const subject& from, std::string_view message, time_point now, const message_sender& by);
    void on_names(const subject& from, std::string_view message);
    void on_control(std::string_view reply, std::string_view message, time_point now, const message_sender& sender);
    [[nodiscard]] bool has_effect(std::string_view where, const subject& about, const message_sender& by);
    void drop_untrusted(const message_sender& by);
    void on_lost(const bridge_id& gone, std::string_view why);
    void send_heartbeat(bool starting);
    void set_due();
    void send_names();
    void send_control(const bridge_id& to, std::string line);
    void check_own_pool(time_point now);
    [[nodiscard]] std::chrono::milliseconds interval() const;

    // sent_requests_events
    void on_answer(const bridge_link& on, std::uint64_t id, std::string_view reply, std::string_view taker) override;
    void cancel_at(const bridge_id& taker, std::uint64_t number) override;
    void on_forgotten(std::uint64_t id) override;

    const settings setup_;
    bridge_output& out_;
    bridge_trust* trust_; // null: the fleet is not secured
    bridge_id self_{};
    std::string replaced_; // the instance before
    std::size_t max_message_ = 0;
    bool connected_ = false;
    bool leaving_ = false;                     // takes no more requests
    std::optional<time_point> starting_until_; // in a secured fleet: others get to know this bridge
    std::optional<time_point> reachable_from_; // other pools, which know it then
    bool left_ = false;
    time_point connected_at_{};
    bool pools_may_appear_ = false; // names with their prefix are taken for theirs
    time_point now_{};
    time_point due_{time_point::max()};
    time_point next_heartbeat_{};
    time_point last_heartbeat_{};
    std::optional<time_point> heartbeat_sent_; // nothing: it has come back
    std::optional<time_point::duration> round_trip_;
    time_point next_names_{};
    time_point next_drop_log_{};
    bool names_wanted_ = false;
    node_names home_;
    pool_table pools_;
    sent_requests sent_;
    std::uint32_t turn_ = 0; // of the bridges of a pool that take requests
    taken_requests taken_;
    std::map<bridge_id, time_point> not_live_; // that have asked and are not live, and when they are forgotten
    foreign_feeds feeds_;
    std::map<std::uint64_t, foreign_noun> binds_; // that are not answered, by the node's id
    published_nouns published_;
    std::map<bridge_id, time_point> asked_names_;  // and when
    std::set<std::string> warned_of_;              // bridges of the own pool that are not at home, and were logged
    std::set<std::string, std::less<>> untrusted_; // members that may not forward, and were logged
    figures figures_;
};

} // namespace cles::bridging
