// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>
#include <cles/sharing.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/base/peer_reply.hpp"
#include "node/node_state.hpp"
#include "node/routing/service_registry.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/outbound.hpp"
#include "node/sharing/movable_request.hpp"
#include "node/sharing/slot_grants.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class local_node;

/// Moves jobs between the queues of nodes (docs/protocol.md, "Work sharing"): with free workers, it grants slots to
/// nodes that have jobs waiting; with jobs waiting, it tells others, and forwards jobs on the grants that it gets.
class work_sharing : public job_sharing, public request_sharing, private deadline {
  public:
    /// What it needs from the node.
    class client {
      public:
        client() = default;
        client(const client&) = delete;
        client& operator=(const client&) = delete;

        /// The other nodes and their tasks; null if this node does not route.
        [[nodiscard]] virtual const service_registry* registry() const = 0;
        /// Whether that node is live, and reached by a stream, without a third node.
        [[nodiscard]] virtual bool is_neighbour(const known_node& other) const = 0;
        /// Passes on a job to the node of the permit. The outcome is reported to `reply`, never inside this call.
        /// Returns a ticket for `cancel`.
        virtual std::uint64_t forward(const forwarding_permit& permit, const protocol::outgoing_request& r,
                                      time_point due, detail::pending_ptr reply,
                                      outbound::progress_function progress) = 0;
        /// Sends a request of this node itself to the node that its noun names.
        virtual void send_own(const protocol::outgoing_request& r, time_point due, detail::pending_ptr reply) = 0;
        /// Cancels it; the outcome may be reported inside this call.
        virtual void cancel(std::uint64_t ticket) = 0;
        virtual std::uint32_t random() = 0;

      protected:
        ~client() = default;
    };

    /// How often waiting jobs are reported, and to how many nodes at once.
    static constexpr std::chrono::milliseconds tell_every{50};
    static constexpr std::size_t told_at_once = 8;
    /// How often a node with free workers looks at the loads that others report.
    static constexpr std::chrono::milliseconds look_every{500};
    /// How long a transfer is assumed to take before one has been measured.
    static constexpr std::chrono::microseconds first_transfer{1'000};
    /// The wait that a transfer saves has to exceed its duration by this factor.
    static constexpr double min_wait_per_transfer = 1.5;
    /// How long it counts how long jobs of a task have taken at another node. So a long job does not end sharing.
    static constexpr std::chrono::milliseconds duration_valid_for{1'000};
    /// How long a slot that was granted with a result is reserved, besides two round trips. The other node uses it at
    /// once or not at all.
    static constexpr std::chrono::milliseconds reserved_for{2};
    /// How long a node is not asked to run jobs of a task that it has refused, unless it says when to retry.
    static constexpr std::chrono::milliseconds refusal_valid_for{1'000};
    static constexpr std::chrono::milliseconds max_retry{10'000};
    /// How long a node that does not share its work is sent nothing.
    static constexpr std::chrono::milliseconds not_shared_for{60'000};
    /// Longer requests do not move. The other node would refuse what is over its limit, and close the link. (Its limit
    /// is not known; this is less than the default.)
    static constexpr std::size_t longest_moved = limits{}.line - limits{}.line / 16;

    /// How many grants of a node are kept at a time. It gives one; others may pose as it, without security.
    static constexpr std::size_t max_held = 8;

    /// All of these outlive this.
    work_sharing(node_state& host, client& out, shareable_queue& jobs, std::uint32_t seed);
    ~work_sharing() override;

    // job_sharing
    [[nodiscard]] bool may_move(const call& job) const noexcept override;
    void on_change() override;
    void withdraw(std::uint64_t ticket) override;

    // request_sharing
    [[nodiscard]] std::optional<movable_request> movable(const protocol::request_line& r, const task_info& task,
                                                         const identity& peer) override;
    [[nodiscard]] std::optional<protocol::failure> use_grant(const protocol::request_line& r, const task_info& task,
                                                             const identity& peer, time_point now) override;
    [[nodiscard]] std::string grant_another(std::string_view to) override;
    void serve_slots(reply_writer& replies, const protocol::request_line& r, const identity& peer,
                     time_point now) override;

    /// To be called before the client is destroyed.
    void withdraw_all();

  private:
    class forwarding; // takes jobs on one grant
    class moved_reply;

    /// What is known of the jobs of one task at another node.
    struct task_there {
        std::optional<std::chrono::microseconds> duration{}; // of a moved job, from here
        time_point duration_until = time_point::min();       // it counts
        time_point refused_until = time_point::min();
    };
    /// What is known of another node.
    struct acquaintance {
        std::uint32_t waiting = 0;                     // jobs there that may be moved, without those of open grants
        time_point heard = time_point::min();          // when it last said so
        std::optional<std::chrono::microseconds> trip; // how long `PUSH cles/slots` takes there and back
        time_point silent_until = time_point::min();   // it does not share its work, and is sent nothing
        // No job was for it when so many had been queued; so it is not told of them until then.
        std::uint64_t unsuitable = 0;
        time_point unsuitable_until = time_point::min();
        std::size_t longest = longest_moved; // request that is sent to it
        std::map<std::string, task_there, std::less<>> tasks{};
    };
    using acquaintances = std::map<std::string, acquaintance, std::less<>>;
    /// The body of `PUSH cles/slots`.
    struct slots_message {
        std::string_view node;
        std::uint32_t free = 0;
        std::uint32_t waiting = 0;
    };
    /// A `PUSH cles/slots` that this node has sent.
    struct sent_slots {
        std::string node;
        std::uint64_t grant = 0; // 0: none
        unsigned slots = 0;      // of the grant
        time_point at{};
    };
    /// A grant of another node that has not been used up.
    struct held_grant {
        std::uint64_t number = 0;
        unsigned left = 0;
        std::uint64_t searched = 0; // how many jobs had been queued when the queue was searched for one
        time_point expires{};
    };
    struct moved_job {
        std::shared_ptr<call> job;
        std::function<void(bool refused)> ended;
        std::string node;
        std::uint64_t grant = 0;
        std::uint64_t request = 0; // the ticket of the client
        time_point sent{};
    };

    [[nodiscard]] static bool read(std::string_view body, std::size_t depth, slots_message& to);
    [[nodiscard]] std::optional<protocol::failure> refusal(const slots_message& said, const protocol::request_line& r,
                                                           const identity& peer) const;
    void balance(time_point now);
    void grant_slots(unsigned slots, const shareable_queue::state& own, time_point now);
    std::uint64_t open_grant(std::string_view to, unsigned slots, time_point now);
    [[nodiscard]] time_point reserve_until(const acquaintance& other, time_point now) const;
    [[nodiscard]] acquaintances::value_type* most_loaded();
    void look_at_loads(time_point now);
    void tell(const shareable_queue::state& own, time_point now);
    void arm_timer(const shareable_queue::state& own, time_point now);
    void push(const sent_slots& what, const std::string& body);
    void on_reply(const sent_slots& what, const peer_answer& found);
    unsigned forward_jobs(const std::string& node, held_grant& by, time_point now);
    void use_held_grants(time_point now);
    void make_room_for_grant(const std::string& of);
    void hold_another(std::uint64_t ticket, std::uint64_t grant);
    held_grant& hold(std::string_view by, std::uint64_t number, unsigned slots, time_point now);
    void on_outcome(std::uint64_t ticket, std::string_view json, subrequest_failure* why);
    void remember_refusal(const moved_job& moved, const protocol::failure& why, time_point now);
    void measure(const moved_job& moved, time_point now);
    [[nodiscard]] bool may_forward_for(std::string_view requester);
    [[nodiscard]] const known_node* find_neighbour(std::string_view name) const;
    void refresh_neighbours();
    void on_deadline(time_point now) override;

    node_state& node_;
    client& out_;
    shareable_queue& jobs_;
    jitter draws_;
    slot_grants granted_;
    acquaintances known_;
    std::map<std::pair<std::string, std::uint64_t>, held_grant> held_; // by node and number
    std::map<std::uint64_t, moved_job> moved_;                         // by ticket
    std::uint64_t last_ticket_ = 0;
    time_point tell_at_ = time_point::min();                                             // not before
    time_point look_at_ = time_point::min();                                             // not before
    std::vector<const known_node*> neighbours_;                                          // scratch
    bool has_logged_why_ = false;                                                        // jobs stay here
    const std::shared_ptr<work_sharing*> alive_ = std::make_shared<work_sharing*>(this); // for late replies
};

/// Lets a node share the jobs of a queue; see `cles::share_jobs`.
[[nodiscard]] std::unique_ptr<job_sharing> make_sharing(local_node& host, shareable_queue& jobs);

} // namespace cles::core
