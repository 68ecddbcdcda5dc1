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

namespace cles::simulation {

/// Hosts on which nodes run, the network between them, and time; and what goes wrong with a node.
class node_hosts {
  public:
    node_hosts(const node_hosts&) = delete;
    node_hosts& operator=(const node_hosts&) = delete;

    [[nodiscard]] agenda& time() noexcept { return time_; }
    [[nodiscard]] network& net() noexcept { return net_; }
    [[nodiscard]] witness& watcher() noexcept { return watcher_; }
    [[nodiscard]] planted fault() const noexcept { return net_.fault(); }
    /// The node that runs there; null while none does.
    [[nodiscard]] node_run* node(unsigned host) const noexcept;

  protected:
    node_hosts(std::uint64_t seed, planted fault) : chance_(seed), net_(time_, watcher_, chance_.next(), fault) {}
    ~node_hosts() = default;

    virtual void start(unsigned host) = 0;
    /// Ends a node as a crash does.
    virtual void end_run(node_run& n) { n.crash(); }
    /// Nothing happens any more. To be called before what `end_run` needs is destroyed.
    void end_all();

    /// Ends the node there as a crash does; after some time another one starts.
    void end_node(unsigned host, std::chrono::milliseconds down);
    /// Stops the process there for some time.
    void freeze(unsigned host, std::chrono::milliseconds span);
    void jump(unsigned host, std::chrono::milliseconds ahead);
    /// The network is well, and on every host a node runs.
    void end_trouble();
    void pass(std::chrono::milliseconds span) { time_.run_until(time_.now() + span); }

    agenda time_;
    witness watcher_{time_};
    dice chance_;
    network net_;
    std::map<unsigned, std::shared_ptr<node_run>> nodes_; // by host; null while none runs there
};

} // namespace cles::simulation
