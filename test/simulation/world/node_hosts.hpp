// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/agenda.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/network/network.hpp"
#include "simulation/network/planted.hpp"
#include "simulation/world/node_run.hpp"
#include "simulation/world/witness.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

namespace cles::simulation {

/// Hosts on which nodes run, the network between them, time, and the faults of nodes.
class node_hosts {
  public:
    node_hosts(const node_hosts&) = delete;
    node_hosts& operator=(const node_hosts&) = delete;

    [[nodiscard]] agenda& time() noexcept { return time_; }
    [[nodiscard]] network& net() noexcept { return net_; }
    [[nodiscard]] witness& watcher() noexcept { return watcher_; }
    [[nodiscard]] planted fault() const noexcept { return net_.fault(); }
    /// The node that runs there; null if there is none.
    [[nodiscard]] node_run* node(unsigned host) const noexcept;
    /// The same; null also if it is suspended.
    [[nodiscard]] node_run* active(unsigned host) const noexcept;
    /// All nodes that run, in the order of their hosts.
    [[nodiscard]] std::vector<node_run*> running() const;

  protected:
    node_hosts(std::uint64_t seed, planted fault) : chance_(seed), net_(time_, watcher_, chance_.next(), fault) {}
    ~node_hosts() = default;

    virtual void start(unsigned host) = 0;
    /// Ends a node as a crash does.
    virtual void end_run(node_run& n) { n.crash(); }
    /// No further events run. Call this before what `end_run` needs is destroyed.
    void end_all();

    /// Checks that a node stays within its limits.
    virtual void check(node_run& n) { n.check_bounds(); }
    /// Checks another node of the first hosts each time.
    void check_next(unsigned hosts) {
        if (auto* n = node(static_cast<unsigned>(time_.steps() / 64 % hosts))) {
            check(*n);
        }
    }

    /// Crashes the node there; after this time another one starts.
    void end_node(unsigned host, std::chrono::milliseconds down);
    /// Suspends the process there for this time.
    void freeze(unsigned host, std::chrono::milliseconds span);
    void jump(unsigned host, std::chrono::milliseconds ahead);
    /// The network works, and a node runs on every host.
    void end_trouble();
    void pass(std::chrono::milliseconds span) { time_.run_until(time_.now() + span); }

    agenda time_;
    witness watcher_{time_};
    dice chance_;
    network net_;
    std::map<unsigned, std::shared_ptr<node_run>> nodes_; // by host; null if none runs there
};

} // namespace cles::simulation
