// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/gossip.hpp>
#include <cles/line_link.hpp>
#include <cles/multicast.hpp>

#include "core/deadline_schedule.hpp"
#include "core/feed_machine.hpp"
#include "core/ip_network.hpp"
#include "core/node.hpp"
#include "core/turns.hpp"
#include "port/environment.hpp"
#include "protocol/grammar.hpp"
#include "shell/connection.hpp"
#include "shell/connections.hpp"
#include "shell/feed_links.hpp"
#include "shell/group.hpp"
#include "shell/listeners.hpp"
#include "shell/neighbours.hpp"
#include "shell/routes.hpp"
#include "shell/routing_part.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::shell {

class departure;

/// How a node is set up: what service_options says, checked by the constructor of local_node.
struct local_node_options {
    core::node_setup node;
    std::map<std::string, std::string> peers{};
    bool insecure = false;
    std::vector<std::string> networks{};
    multicast_options multicast{};
    gossip_options gossip{};
    std::function<void(std::string_view where)> on_name_taken{};
    const detail::routing_part* routing = nullptr;
};

/// The node of this process: its state, its links and the ways to others, and what drives them. Decides, and meets the
/// world through its environment alone.
class local_node : public std::enable_shared_from_this<local_node>, private core::turn_host, private core::task {
  public:
    /// Draws the epoch and what else is random, and has completions called by the environment. \throws cles::error
    local_node(std::shared_ptr<core::environment> by, local_node_options options);
    ~local_node() override;

    /// Begins; to be called once, when this is owned.
    void start(const std::vector<std::string>& listen_at);
    std::string listen(std::string_view where);
    virtual void stop();
    /// Ends in order what is to be ended; the operation ends when the links have. `stop` is to follow.
    std::uint64_t close(std::chrono::milliseconds limit, detail::pending_ptr operation);
    /// Nothing is begun any more for others.
    [[nodiscard]] bool closing() const noexcept { return departure_ != nullptr; }

    // For the rooms beneath.
    [[nodiscard]] core::node& node() noexcept { return *node_; }
    [[nodiscard]] const std::shared_ptr<core::node>& shared_node() const noexcept { return node_; }
    [[nodiscard]] const limits& bounds() const noexcept { return node_->bounds; }
    [[nodiscard]] core::deadline_queue& deadlines() noexcept { return node_->deadlines; }
    /// By which the user's code is called.
    [[nodiscard]] core::completion_queue& completions() noexcept { return node_->completions; }
    [[nodiscard]] core::environment& environment() noexcept { return *environment_; }
    [[nodiscard]] time_point now() const { return environment_->now(); }
    /// The address of a peer that might be another than it says, for which there is a limit on what is sent there;
    /// empty for others.
    [[nodiscard]] std::string stranger(const identity& peer) const;
    void say(log_level level, const log_entry& what) const { node_->say(level, what); }
    /// The same from inside a loop over what the log's reader could change.
    void say_soon(log_level level, std::string what, std::string peer = {}) const {
        node_->say_soon(level, std::move(what), std::move(peer));
    }
    [[nodiscard]] shell::connections& connections() noexcept { return connections_; }
    [[nodiscard]] shell::listeners& listeners() noexcept { return listeners_; }
    [[nodiscard]] shell::routes& routes() noexcept { return routes_; }
    [[nodiscard]] shell::neighbours& neighbours() noexcept { return *neighbours_; }
    /// The multicast group; null where it is off.
    [[nodiscard]] shell::group* group() noexcept { return group_.get(); }
    /// The nodes that are there have been found, as far as could be waited for.
    void on_round_over();
    /// This node's name is another's.
    void on_name_taken(const std::string& where);
    /// A connection has ended.
    void forget(shell::connection& c, std::uint64_t received, std::uint64_t sent);
    [[nodiscard]] core::turns& turns() noexcept { return turns_; }
    /// What routing has to do; null where it is off.
    [[nodiscard]] detail::routing_host* routing() noexcept { return routing_.get(); }

    // turn_host
    void post_turn() override;
    [[nodiscard]] bool stopped() const override { return stopped_; }
    [[nodiscard]] core::publications& published() override { return node_->published; }
    void route_on(time_point now) override;
    /// To be called when something has happened: sets the timer.
    void settle() override;

    // For the façade.
    void publish(std::string_view noun, const std::function<void(json_writer&)>& write);
    /// Returns a ticket by which it can be withdrawn while it waits; 0 where it does not.
    std::uint64_t publish_when_room(std::string_view noun, std::string_view json, detail::pending_ptr operation);
    std::uint64_t send(verb how, std::string_view text, std::string_view body, const call_options& options,
                       detail::pending_ptr operation);
    void cancel(std::uint64_t ticket);
    /// Completes an operation that failed while it began; not from inside the call.
    void fail_later(detail::pending_ptr operation, boost::system::error_code code, std::string message,
                    core::completion::progress_function progress = {});

    // For the feeds.
    [[nodiscard]] shell::feed_links& feeds() noexcept { return feeds_; }
    [[nodiscard]] std::uint64_t draw_id() noexcept { return node_->next_id++; }

  private:
    void run() override; // a turn
    void join_group();
    void on_timer();
    void check_path(std::string_view noun) const;

    std::shared_ptr<core::environment> environment_;
    std::shared_ptr<core::node> node_;
    core::deadline_schedule schedule_;
    bool insecure_;
    core::ip_networks networks_;
    multicast_options multicast_;
    gossip_options gossip_;
    shell::routes routes_{*this};
    shell::listeners listeners_{*this};
    shell::connections connections_{*this};
    shell::feed_links feeds_{*this};
    std::unique_ptr<shell::group> group_;
    std::unique_ptr<shell::neighbours> neighbours_;
    std::function<void(std::string_view)> on_name_taken_;
    const detail::routing_part* routing_wanted_;
    std::unique_ptr<detail::routing_host> routing_; // null: off
    core::turns turns_{*this, *environment_};
    std::unique_ptr<shell::departure> departure_; // once it is to end in order
    bool stopped_ = false;
};

} // namespace cles::shell
