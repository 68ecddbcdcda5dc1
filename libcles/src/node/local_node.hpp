// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/gossip.hpp>
#include <cles/line_link.hpp>
#include <cles/multicast.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/peer_reply.hpp"
#include "node/flush_scheduler.hpp"
#include "node/membership/discovery.hpp"
#include "node/node_state.hpp"
#include "node/publish/feed_links.hpp"
#include "node/publish/multicast_group.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/routing/router.hpp"
#include "node/session/connections.hpp"
#include "port/environment.hpp"
#include "port/ip_network.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// The settings of a node, from service_options; the constructor of local_node checks them.
struct local_node_options {
    node_options node;
    std::map<std::string, std::string> peers{};
    bool insecure = false;
    std::vector<std::string> networks{};
    multicast_options multicast{};
    gossip_options gossip{};
    std::function<void(std::string_view where)> on_name_taken{};
    const detail::routing_part* routing = nullptr;
};

/// Which option is invalid, and why; empty if none is.
[[nodiscard]] std::string invalid_option_reason(const call_options& options);
[[nodiscard]] std::string invalid_option_reason(const bind_options& options);

/// Why a request cannot be sent on behalf of the member that the options name; nothing if it can. \pre they name one
[[nodiscard]] std::optional<protocol::failure> objection_to_member(const node_state& n, const call_options& options,
                                                                   verb how, const protocol::noun_view& noun);

/// The time limit for a given deadline: the verb's default if it is 0, and at most a day.
[[nodiscard]] std::chrono::milliseconds time_limit(std::chrono::milliseconds deadline, verb of);

/// The node of this process: its state, its links and its channels to others, and what drives them. It makes the
/// decisions; all input and output goes through its environment.
class local_node : public std::enable_shared_from_this<local_node>, private flush_host, private task {
  public:
    /// Draws the epoch and other random values, and has the environment call completions. \throws cles::error
    local_node(std::shared_ptr<core::environment> by, local_node_options options);
    ~local_node() override;

    /// To be called once, when a shared_ptr owns this.
    void start(const std::vector<std::string>& listen_at);
    /// Whether it may be reached from other hosts, although they are not authenticated.
    [[nodiscard]] bool is_insecure() const noexcept { return options_.insecure; }
    std::string listen(std::string_view where);
    virtual void stop();
    /// Starts a graceful shutdown; the operation completes when the links have closed. Call `stop` afterwards.
    std::uint64_t close(std::chrono::milliseconds limit, detail::pending_ptr operation);
    /// Whether requests of others are no longer started.
    [[nodiscard]] bool closing() const noexcept { return graceful_shutdown_.has_value(); }

    // For the subsystems.
    [[nodiscard]] node_state& node() noexcept { return *node_; }
    [[nodiscard]] const std::shared_ptr<node_state>& shared_node() const noexcept { return node_; }
    [[nodiscard]] const limits& bounds() const noexcept { return node_->bounds; }
    [[nodiscard]] deadline_queue& deadlines() noexcept { return node_->deadlines; }
    /// Calls the user's code.
    [[nodiscard]] completion_queue& completions() noexcept { return node_->completions; }
    [[nodiscard]] core::environment& environment() noexcept { return *environment_; }
    [[nodiscard]] time_point now() const { return environment_->now(); }
    /// The address of a peer whose address may be forged, for which there is a limit on what is sent there; empty for
    /// others.
    [[nodiscard]] std::string unverified_address(const identity& peer) const;
    /// The address of this node itself, at which it serves its program's requests for `any` and `all`, and those on
    /// behalf of members. These are forwarded as those of other clients, so none leaves without the right to forward.
    [[nodiscard]] std::string own_url() const { return "inproc://" + listeners_.self_endpoint(); }
    void write_log(log_level level, const log_entry& what) const { node_->write_log(level, what); }
    /// The same from inside a loop over data that the log function could change.
    void post_log(log_level level, std::string what, std::string peer = {}) const {
        node_->post_log(level, std::move(what), std::move(peer));
    }
    [[nodiscard]] core::connections& connections() noexcept { return connections_; }
    [[nodiscard]] core::listeners& listeners() noexcept { return listeners_; }
    [[nodiscard]] core::peer_channels& peer_channels() noexcept { return peer_channels_; }
    [[nodiscard]] core::discovery& discovery() noexcept { return *discovery_; }
    /// Null if multicast is off.
    [[nodiscard]] multicast_group* group() noexcept { return group_.get(); }
    /// Cancels a request that was sent. Returns false if there is none with that id.
    bool cancel_sent(std::uint64_t id) { return peer_channels_.cancel(id) || connections_.cancel(id); }
    /// Some or all names that are unknown will not become known any more.
    void on_discovery_grace_changed();
    /// This node's name belongs to the node at `where`.
    void on_name_taken(const std::string& where);
    [[nodiscard]] core::flush_scheduler& flush_scheduler() noexcept { return flush_scheduler_; }

    /// Calls `function` with this node in a task of its own, unless the node has been stopped or destroyed by then.
    template <class F>
    void post_while_running(F function) {
        post(*environment_, [weak = weak_from_this(), function = std::move(function)]() mutable {
            if (const auto self = weak.lock(); self && !self->stopped_) {
                function(*self);
            }
        });
    }

    /// An operation that passes the outcome of its request to `then`, unless the node has been stopped or destroyed by
    /// then. `checks_json`: replies that are not JSON do not count.
    [[nodiscard]] detail::pending_ptr
    reply_while_running(std::function<void(local_node& host, const peer_answer& found)> then, bool checks_json = false);

    // flush_host
    void post_flush() override;
    [[nodiscard]] bool stopped() const override { return stopped_; }
    void drain_routing(time_point now) override;
    void check_shutdown() override;

    // For the public API.
    void publish(std::string_view noun, const std::function<void(json_writer&)>& write);
    /// Returns a ticket that cancels the operation while it waits; 0 if it does not wait.
    std::uint64_t publish_or_wait(std::string_view noun, std::string_view json, detail::pending_ptr operation);
    std::uint64_t send(verb how, std::string_view text, std::string_view body, const call_options& options,
                       detail::pending_ptr operation);
    /// Sends a command such as "PULL car0:localization". One that is malformed, or that cannot be sent as a request,
    /// fails with `bad_request`. `left` also limits the time for the reply.
    std::uint64_t send_command(std::string_view command, const call_options& options, detail::pending_ptr operation,
                               std::optional<std::chrono::milliseconds> left = std::nullopt);
    void cancel(std::uint64_t ticket);
    /// Completes an operation that failed at its start, but not from inside the call. Returns 0, the ticket of such an
    /// operation.
    std::uint64_t fail_later(detail::pending_ptr operation, boost::system::error_code code, std::string message,
                             completion::progress_function progress = {});

    // For the feeds.
    [[nodiscard]] feed_links& feeds() noexcept { return feeds_; }
    [[nodiscard]] std::uint64_t draw_id() noexcept { return node_->next_id++; }

  private:
    void run() override; // one turn
    void join_group();
    void on_timer();
    void check_noun(std::string_view noun) const;

    std::shared_ptr<core::environment> environment_;
    ip_networks networks_;
    std::shared_ptr<node_state> node_;
    deadline_schedule schedule_{*environment_};
    const local_node_options options_; // as given at the start; without `node`, which the state has
    core::peer_channels peer_channels_{*this};
    core::listeners listeners_{*this};
    core::connections connections_{*this};
    feed_links feeds_{*this};
    std::unique_ptr<multicast_group> group_;
    std::unique_ptr<core::discovery> discovery_;
    std::shared_ptr<router> routing_; // null: off
    core::flush_scheduler flush_scheduler_{*this, *node_};
    std::optional<graceful_shutdown> graceful_shutdown_; // set once a graceful shutdown has started
    bool stopped_ = false;
};

} // namespace cles::core
