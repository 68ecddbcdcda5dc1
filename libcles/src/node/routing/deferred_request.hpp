// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/update_mark.hpp>

#include "node/base/deadlines.hpp"
#include "node/routing/request_router.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/call.hpp"
#include "port/request_origin.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// A request that may have to wait until a node is known that offers its task.
///
/// Starting it runs handlers of this node, which may do anything. So it is started where its line is read, or in a
/// turn: never when a node becomes known, when another node replies, or at a deadline, because the library does these
/// in loops.
class deferred_request : public std::enable_shared_from_this<deferred_request> {
  public:
    deferred_request(std::shared_ptr<request_router> by, std::shared_ptr<call> answers, time_point due)
        : routing_(std::move(by)), call_(std::move(answers)), reply_due_(due) {}
    deferred_request(const deferred_request&) = delete;
    deferred_request& operator=(const deferred_request&) = delete;
    virtual ~deferred_request() = default;

    /// Starts or continues it. Returns false if it still has to wait.
    virtual bool begin(time_point now) = 0;
    /// Whether its client no longer waits for it.
    [[nodiscard]] virtual bool over() const { return call_->ended(); }

  protected:
    /// From now on, `withdraw` is called if the call ends without a reply.
    void follow_call();

    const std::shared_ptr<request_router> routing_;
    std::shared_ptr<call> call_;
    const time_point reply_due_;

  private:
    virtual void withdraw() = 0;
};

/// One that is sent to other nodes as it is.
class client_request : public deferred_request {
  public:
    client_request(std::shared_ptr<request_router> by, const protocol::request_line& r, const identity& peer,
                   std::shared_ptr<call> answers, time_point due);

  protected:
    protocol::owned_request request_;
    const identity& peer_;      // valid until the call has ended
    const owned_origin origin_; // whose rights apply
};

/// A request for a client at one node.
struct attempt {
    std::uint64_t ticket = 0;              ///< of another node
    std::unique_ptr<local_request> here{}; ///< at this node
};

/// A request for `any`: sends it to one node, and to another if that one cannot be reached or refuses the work before
/// it starts. Work that has started and is lost is repeated only if that does no harm, and only once, so that a request
/// that crashes its node does not go from node to node.
class any_request final : public client_request {
  public:
    /// The maximum number of busy nodes that are asked, so that repeats do not load a full network further.
    static constexpr int max_busy = 3;

    using client_request::client_request;

    /// Sends the request to `chosen`.
    void ask(const load_balancer::chosen& chosen, time_point now);
    /// Continues after this node has refused the request before starting it.
    void continue_after_local_refusal(const protocol::failure& why);
    /// Selects a node, or another one. Returns false if it has to wait for more nodes to be discovered.
    bool begin(time_point now) override;

  private:
    void withdraw() override { routing_->cancel(part_); }
    void ask_other(std::string node);
    void note_asked(std::string node);
    [[nodiscard]] subrequest_outcome outcome();
    [[nodiscard]] std::string next_pool() const;
    [[nodiscard]] bool is_held_back(const load_balancer::chosen& chosen) const;
    void on_outcome(std::string_view json, subrequest_failure* why);
    void try_next(subrequest_failure why);
    void give_up(protocol::failure why, bool may_have_started);
    [[nodiscard]] bool may_repeat(const subrequest_failure& why) const noexcept;
    void note_end(const subrequest_failure* why);

    std::vector<std::string> asked_; // the last one is asked now
    attempt part_;                   // at that node
    bool idempotent_ = false;        // at that node
    int busy_ = 0;
    std::optional<protocol::failure> last_busy_;
    std::optional<protocol::failure> lost_;         // from a node that may have started it
    std::optional<subrequest_failure> retry_after_; // after this failure, it is sent to another node
};

/// What one node has replied to a request for `all`: a result or a failure, or neither yet.
struct node_outcome {
    std::optional<std::string> result{};
    std::optional<protocol::failure> failure{};
    std::optional<update_mark> mark{}; ///< which update the result is

    [[nodiscard]] bool is_open() const noexcept { return !result && !failure; }
};

/// The reply to a request for `all`: the outcome at each node, in the order of their names.
class aggregate_reply {
  public:
    /// `with_marks`: it contains the known marks of the results, if there are any.
    explicit aggregate_reply(bool with_marks = false) : with_marks_(with_marks) {}

    void add(std::string_view node, const node_outcome& found);
    /// What all nodes of another pool have replied. A failure means that nothing is known of its nodes; without a
    /// provider of the task there, nothing is added.
    void add_pool(std::string_view pool, const node_outcome& found);
    /// Nothing was added.
    [[nodiscard]] bool is_empty() const noexcept { return results_.empty() && errors_.empty(); }
    [[nodiscard]] std::string whole() const;

  private:
    void add_error(std::string_view node, protocol::failure why);

    bool with_marks_;
    std::string results_;
    std::string errors_;
    std::string marks_;
};

/// When the reply is to be sent, so that it arrives before the deadline.
time_point answer_by(time_point due, time_point now);
/// Until when to wait for nodes whose tasks are not known yet: at most one second, and at most half of the remaining
/// time.
time_point stop_waiting_at(time_point due, time_point now);

/// A request for `all`: sends it at once to all nodes that offer the task, and replies with their outcomes, at the
/// latest shortly before the deadline.
class scatter_gather final : public client_request, private deadline {
  public:
    using client_request::client_request;

    /// Sends the requests. Returns false if it has to wait for more nodes to be discovered.
    bool begin(time_point now) override;

  private:
    struct part : attempt, node_outcome {
        std::string node; ///< for another pool, "north.all"
        std::string pool{};
    };

    void on_outcome(part& at, std::string_view json, subrequest_failure* why);
    void on_deadline(time_point now) override;
    /// Returns false if none is known, and seeds may still answer.
    bool ask_known(time_point now);
    part* add(std::string node);
    void add_pools();
    void ask_all(time_point now);
    void follow();
    void finish();
    void withdraw() override;

    std::vector<part> parts_; // by name
    std::size_t bytes_ = 0;   // of results
    bool begun_ = false;
    bool has_waited_ = false; // as long as permitted
    bool ended_ = false;
};

} // namespace cles::core
