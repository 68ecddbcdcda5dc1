// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/base/metrics.hpp"
#include "node/membership/gossip_contacts.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "node/membership/reachability.hpp"
#include "node/membership/reachable_endpoints.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class node_security;
class local_node;

/// Decides which nodes are asked for their tables, and when (docs/protocol.md, "Gossip"): the successor by name, so
/// that each node is asked by some node; two random nodes, so that changes spread fast; and from time to time a lost
/// node. Where some nodes have no link to each other, all neighbours are asked, for routes too ("Routes").
///
/// What the rest of the node calls is virtual, so that a program that does not take part in gossip does not link it.
class gossip : private deadline {
  public:
    /// Sends the requests. The outcome of a ticket is reported to `on_answer`, `on_description` or `on_failure`, never
    /// from inside the call.
    class client : public reachability::listener {
      public:
        client() = default;
        client(const client&) = delete;
        client& operator=(const client&) = delete;
        /// Where to send a request. With a `node`, only that member may answer there.
        struct destination {
            std::string_view url;
            std::string_view node{}; ///< empty without security, and as long as it is not known
        };
        /// `PULL self:cles/peers since=... describe=... routes=...`, without those that are empty.
        virtual void ask(std::uint64_t ticket, const destination& at, const table_question& what) = 0;
        /// `PULL self:cles`.
        virtual void ask_description(std::uint64_t ticket, const destination& at) = 0;
        /// `PUSH self:cles/peers`; the outcome is not reported.
        virtual void push(const destination& at, std::string_view table) = 0;
        /// No requests follow there for a while.
        virtual void release(const destination& at) = 0;
        /// Every seed has answered or refused, once or more.
        virtual void on_seeds_heard() {}
        /// A signed announcement states this version of its node's roster.
        virtual void on_stated_roster(std::string_view, std::uint32_t) {}

      protected:
        ~client() = default;
    };

    static constexpr std::size_t random_contacts = 2;        ///< number of random nodes to ask
    static constexpr std::chrono::milliseconds limit{2'000}; ///< for a reply
    static constexpr unsigned max_failures = 2;              ///< in a row, before the node is replaced
    static constexpr int turns_per_interval = reachability::turns_per_interval;
    static constexpr int turns_among_few = 4;            ///< if all others are asked
    static constexpr int intervals_of_rest = 2;          ///< after a failure
    static constexpr int intervals_of_stay = 30;         ///< of a random node
    static constexpr std::size_t bytes_a_second = 4096;  ///< average for tables that are always sent whole
    static constexpr std::size_t max_neighbours = 16;    ///< that are asked for routes
    static constexpr std::size_t max_pushed_routes = 20; ///< in a message: they fit into a datagram

    struct self {
        std::string name;
        std::string epoch; ///< as text
    };

    /// `security`: null if the node is not secured; otherwise only signed entries count.
    gossip(self who, client& out, membership& others, counters& counts, deadline_queue& deadlines, std::size_t most,
           std::uint32_t seed, const node_security* security = nullptr);

    virtual ~gossip() = default;

    virtual void start(time_point now);
    /// Sends its leave to the nodes it asks, if this node has announced itself. It keeps asking.
    virtual void leave(time_point now);
    /// Leaves, and stops asking.
    virtual void stop(time_point now);
    virtual void set_seeds(const std::vector<std::string>& urls, time_point now);
    /// Whether a seed has neither told of itself nor refused.
    [[nodiscard]] bool awaits_seeds() const { return !seeds_.all_heard(); }
    /// By which neighbour each node is reached.
    [[nodiscard]] reachability& reach() noexcept { return reach_; }

    void on_answer(std::uint64_t ticket, std::string_view json, time_point now);
    void on_description(std::uint64_t ticket, std::string_view json, time_point now);
    /// `silent`: the node has not replied at all.
    void on_failure(std::uint64_t ticket, time_point now, bool silent = true);

    /// Answers the gossip request of another node: writes what has changed, in at most `longest` bytes including the
    /// head of the reply.
    virtual void write_delta(json_writer& w, const table_question& asked, std::size_t longest, time_point now);
    /// Reads entries that were sent without a request. Returns false if `json` is not a table.
    virtual bool on_pushed_table(std::string_view json, const observed_source& by, time_point now);
    /// A node was removed without having left.
    virtual void on_gone(std::string_view node, std::string_view where, time_point now);

    /// The nodes that are asked regularly, for inspection.
    [[nodiscard]] std::vector<std::string> asked() const;

  private:
    using contact = gossip_contact;
    using part = gossip_contact::part;

    /// What a table has shown.
    struct learned {
        std::string newcomer; ///< the last node that was not known before; empty: none
        std::string missing;  ///< unknown incarnations of which only heartbeats arrived: epochs, separated by commas
    };
    learned apply(const peer_table& table, const observed_source& by, time_point asked, time_point now);
    membership::verdict apply(const peer_report& report, const observed_source& by, time_point asked, time_point now);
    membership::verdict apply_signed(const peer_report& report, const observed_source& by, time_point asked,
                                     time_point now);
    void push_routes(time_point now);
    [[nodiscard]] bool can_be_asked(const membership::member& k, time_point now) const;
    void notice_silence(time_point now);
    [[nodiscard]] std::chrono::nanoseconds silence_of(const contact& c) const;
    [[nodiscard]] bool is_of_owner(const peer_table& table) const;
    [[nodiscard]] client::destination destination_of(const contact& c) const noexcept;
    bool read(std::string_view json, std::size_t max_entries, peer_table& table) const;

    void on_deadline(time_point now) override;
    void review(time_point now);
    void drop_unresponsive(time_point now);
    void choose_successor(time_point now);
    void choose_at_random(time_point now);
    void choose_neighbours(time_point now);
    void choose(const membership::member& k, time_point now);
    void contact_bootstraps(time_point now);
    void call(contact& c, time_point now);
    void send_own_entry(contact& c, time_point now);
    void send_own_entry_if_not_asked(time_point now);
    void postpone(contact& c, time_point now);
    /// `heard`: it has told of itself, or refused.
    void end(contact& c, bool rests, time_point now, bool heard = true);
    void sweep();
    void follow(time_point now);
    [[nodiscard]] time_point due_of(const contact& c, time_point now) const;

    [[nodiscard]] std::chrono::milliseconds interval() const noexcept;
    [[nodiscard]] std::chrono::milliseconds search_pause() const noexcept;
    [[nodiscard]] std::chrono::milliseconds until_next_search() noexcept;

    const self self_;
    client& out_;
    membership& others_;
    counters& counts_;
    deadline_queue& deadlines_;
    const node_security* security_;
    jitter jitter_;
    seeds seeds_;
    lost_nodes lost_;
    gossip_contacts contacts_;
    announce_only_nodes announce_only_;
    reachability reach_;
    std::optional<std::string> unknown_peer_; // sent its own entry, and is to be asked
    time_point next_search_{};
    time_point next_successor_ = time_point::min();
    time_point last_asked_{};
    std::uint64_t last_ticket_ = 0;
    bool started_ = false;
    bool left_ = false;
};

} // namespace cles::core

namespace cles::detail {

/// Creates the gossip of a service.
struct gossip_part {
    std::unique_ptr<core::gossip> (*make)(core::local_node& host, std::uint32_t seed);
};

} // namespace cles::detail
