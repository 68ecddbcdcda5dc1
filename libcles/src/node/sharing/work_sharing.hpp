// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>
#include <cles/sharing.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/node_state.hpp"
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
#include <vector>

namespace cles::core {

/// Moves jobs between the queues of nodes (docs/protocol.md, "Work sharing"): with free workers, it grants slots to
/// nodes that have jobs waiting; with jobs waiting, it tells others, and forwards jobs on the grants that it gets.
class work_sharing : public job_sharing, public request_sharing, private deadline {
  public:
    /// Another node that is reached without a third one.
    struct neighbour {
        std::string_view name;
        node_load load;
        time_point seen{}; ///< when it last reported its load
    };
    /// What it needs from the node.
    class client {
      public:
        client() = default;
        client(const client&) = delete;
        client& operator=(const client&) = delete;

        /// The neighbours that are live, by name. Valid until the next change of membership.
        virtual void list_neighbours(std::vector<neighbour>& to) const = 0;
        /// Whether that node is a neighbour that offers DELEGATE of the task.
        [[nodiscard]] virtual bool offers(std::string_view node, std::string_view task) const = 0;
        /// Sends `PUSH cles/slots`. Its reply is passed to `on_reply`, not inside this call. \param grant 0: none
        virtual void push_slots(std::string_view node, std::uint64_t grant, std::string_view body) = 0;
        /// Sends a request, whose outcome is reported to `reply`, never inside this call. Returns a ticket for
        /// `cancel`.
        virtual std::uint64_t forward(const protocol::outgoing_request& r, time_point due, detail::pending_ptr reply,
                                      outbound::progress_function progress) = 0;
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
    static constexpr double worth = 1.5;

    /// All of these outlive this.
    work_sharing(node_state& host, client& out, shareable_queue& jobs, std::uint32_t seed);
    ~work_sharing() override;

    // job_sharing
    void on_change() override;
    void withdraw(std::uint64_t ticket) override;

    // request_sharing
    [[nodiscard]] std::unique_ptr<const movable_request> movable(const protocol::request_line& r,
                                                                 const identity& peer) const override;
    [[nodiscard]] std::optional<protocol::failure> use_grant(const protocol::request_line& r, const identity& peer,
                                                             time_point now) override;
    [[nodiscard]] std::string grant_another(std::string_view to) override;
    void serve_slots(reply_writer& replies, const protocol::request_line& r, const identity& peer,
                     time_point now) override;

    /// To be called before the client is destroyed.
    void withdraw_all();
    /// The reply to `push_slots`; empty if there is none.
    void on_reply(std::string_view node, std::uint64_t grant, std::string_view json, time_point now);

  protected:
    /// Expires with this, for replies that come later.
    [[nodiscard]] std::weak_ptr<work_sharing*> alive() const noexcept { return alive_; }

  private:
    class forwarding; // takes jobs on one grant
    class moved_reply;

    /// What is known of another node.
    struct acquaintance {
        std::uint32_t waiting = 0;                        // jobs there that may be moved
        time_point heard = time_point::min();             // when it last said so
        time_point asked{};                               // when `push_slots` was sent to it
        unsigned granted = 0;                             // with that, and not taken yet
        std::optional<std::chrono::microseconds> trip;    // how long `push_slots` takes there and back
        std::optional<std::chrono::microseconds> surplus; // what moved jobs take longer than their work
    };
    /// The body of `PUSH cles/slots`.
    struct slots_message {
        std::string_view node;
        std::uint64_t free = 0;
        std::uint64_t waiting = 0;
        std::uint64_t service_us = 0;
    };
    /// A grant of another node that has not been used up.
    struct held_grant {
        std::uint64_t number = 0;
        unsigned left = 0;
        time_point expires{};
        std::chrono::microseconds work{0}; // how long a job takes there
    };
    struct moved_job {
        std::shared_ptr<call> job;
        std::function<void(bool refused)> ended;
        std::string node;
        std::uint64_t request = 0; // the ticket of the client
        time_point sent{};
        std::chrono::microseconds work{0}; // how long a job takes there
    };

    [[nodiscard]] static bool read(std::string_view body, std::size_t depth, slots_message& to);
    [[nodiscard]] std::optional<protocol::failure> refusal(const slots_message& said, const protocol::request_line& r,
                                                           const identity& peer) const;
    void balance(time_point now);
    void grant_slots(unsigned slots, const shareable_queue::state& own, time_point now);
    std::uint64_t open_grant(std::string_view to, unsigned slots, unsigned reserved, time_point now);
    void look_at_loads(time_point now);
    void tell(std::uint32_t waiting, time_point now);
    void follow(const shareable_queue::state& own, time_point now);
    void push(std::string_view node, std::uint64_t grant, const std::string& body, time_point now);
    unsigned forward_jobs(const std::string& node, held_grant& by, time_point now);
    void use_held_grants(time_point now);
    void hold_another(std::uint64_t ticket, std::uint64_t grant);
    held_grant& hold(std::string_view by, std::uint64_t number, unsigned slots, time_point now);
    void on_outcome(std::uint64_t ticket, std::string_view json, subrequest_failure* why);
    [[nodiscard]] std::chrono::microseconds transfer_to(std::string_view node) const;
    void list_neighbours();
    void on_deadline(time_point now) override;

    node_state& node_;
    client& out_;
    shareable_queue& jobs_;
    jitter draws_;
    slot_grants granted_;
    std::map<std::string, acquaintance, std::less<>> known_;
    std::map<std::string, held_grant, std::less<>> held_;
    std::map<std::uint64_t, moved_job> moved_; // by ticket
    std::uint64_t last_ticket_ = 0;
    time_point tell_at_ = time_point::min();                                             // not before
    time_point look_at_ = time_point::min();                                             // not before
    std::vector<neighbour> neighbours_;                                                  // scratch
    const std::shared_ptr<work_sharing*> alive_ = std::make_shared<work_sharing*>(this); // for late replies
};

} // namespace cles::core
