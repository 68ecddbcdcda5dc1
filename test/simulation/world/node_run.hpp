// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/pending.hpp>
#include <cles/verb.hpp>

#include "node/local_node.hpp"
#include "node/membership/membership.hpp"
#include "node/session/outbound.hpp"
#include "simulation/network/link_security.hpp"
#include "simulation/network/network.hpp"
#include "simulation/network/place.hpp"
#include "simulation/network/virtual_environment.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

class part_list;

/// An operation whose result is passed to one of two functions, unless it is discarded.
detail::pending_ptr when_ended(std::function<void(std::string_view json)> succeeded,
                               std::function<void(errc code, std::string_view why)> failed = {});

/// A request as a simulated program sends it.
struct request_order {
    cles::verb verb = verb::pull;
    std::string_view noun;
    std::string_view body{};
    std::chrono::milliseconds deadline{0};
    std::uint32_t hops = 8;
};

/// One incarnation of a node, from its start to its end or crash: the library's node in an environment of virtual time.
class node_run final : public place, private core::membership::watcher {
  public:
    struct options {
        std::uint64_t seed = 0; ///< of its own random numbers
        limits bounds{};
        bool strangers = false;            ///< output to sources of datagrams is limited
        bool multicast = false;            ///< it takes part in the group
        const part_list* judges = nullptr; ///< learn what it sends, receives and reports; null: none
        std::function<node_load()> load{};
        const detail::routing_part* routing = nullptr;
        std::shared_ptr<simulated_security> security{}; ///< null: none
        /// Where others are, by name.
        std::map<std::string, std::string> peers{};
        gossip_options gossip{};
    };

    node_run(network& net, unsigned host, unsigned run, std::string name, options how);
    ~node_run() override;

    /// Listens, and joins the group. Call this once, when it is owned by a shared pointer.
    void start();
    /// Stops it as `service::stop` does; `crash` has to follow.
    void stop();
    /// Ends the process at once: the system closes its sockets.
    void crash();

    [[nodiscard]] simulated_security* security() noexcept override { return security_.get(); }
    void on_link_sends(const identity& to, std::string_view line) override;
    void on_link_receives(const identity& from, std::string_view line) override;
    [[nodiscard]] const part_list& judges() const noexcept { return judges_; }

    [[nodiscard]] core::node_state* node() noexcept { return &local_->node(); }
    [[nodiscard]] core::local_node& local() noexcept { return *local_; }
    [[nodiscard]] const std::shared_ptr<core::local_node>& shared_local() const noexcept { return local_; }
    [[nodiscard]] const limits& bounds() const noexcept { return local_->bounds(); }
    [[nodiscard]] witness& watcher() noexcept { return net_.watcher(); }
    [[nodiscard]] planted fault() const noexcept { return net_.fault(); }
    /// The number of this incarnation on its host, from 1.
    [[nodiscard]] unsigned run_number() const noexcept { return run_; }
    /// By the node's own clock.
    [[nodiscard]] time_point started_at() const noexcept { return started_; }
    /// Null if it does not take part in multicast.
    [[nodiscard]] group_port* group() const noexcept { return environment_->group(); }
    /// Stops announcing itself, and its farewell is not received.
    void fall_silent();

    /// The URL at which that node is asked; empty: it is known by its name.
    [[nodiscard]] std::string address_for(unsigned to, carrier by) const;
    /// Sends a request to the node of a host, independently of the name in the noun.
    std::uint64_t ask(unsigned to, carrier by, const request_order& what, detail::pending_ptr operation,
                      core::outbound::progress_function progress = {});
    void cancel(std::uint64_t id) { local_->cancel(id); }

    /// Checks that its memory is within its limits.
    void check_bounds();
    /// Checks that nothing is kept after a long time without activity.
    void check_rest();

  private:
    void after_jump() override { environment_->on_jump(); }
    void on_peer(std::string_view node, core::membership::change what, std::string_view where) override;
    void complain(rule which, const std::string& what) { watcher().broken(which, name() + ": " + what); }

    network& net_;
    unsigned run_;
    const part_list& judges_;
    std::shared_ptr<simulated_security> security_;
    std::shared_ptr<virtual_environment> environment_;
    std::shared_ptr<core::local_node> local_;
    core::membership::watcher& told_; // the node's own watcher
    time_point started_{};
};

} // namespace cles::simulation
