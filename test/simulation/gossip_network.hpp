// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/agenda.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/network/planted.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace cles::simulation {

/// The properties of the network between nodes that gossip.
struct gossip_weather {
    unsigned loss = 0; ///< of packets, per mille: their contents arrive later
    std::chrono::microseconds quickest{200};
    std::chrono::microseconds slowest{5'000};
    unsigned paused = 0; ///< of each node's time, per mille
    std::chrono::milliseconds shortest_pause{200};
    std::chrono::milliseconds max_pause{10'000};
};

/// Hundreds or thousands of nodes that discover each other by seeds and gossip, in virtual time. The decisions are made
/// by the library's own classes: membership, announcer, gossip, and the tables as text. Links and faults are simulated.
class gossip_network {
  public:
    using milliseconds = std::chrono::milliseconds;

    explicit gossip_network(std::uint64_t seed, gossip_weather weather = {}, planted fault = planted::none);
    gossip_network(const gossip_network&) = delete;
    gossip_network& operator=(const gossip_network&) = delete;
    ~gossip_network();

    /// Starts nodes within this time, the first few of which are the seeds of all; returns the first one's number.
    std::size_t start(std::size_t count, milliseconds within, std::size_t seeds = 3);
    /// Advances the time.
    void pass(milliseconds span) { time_.run_until(time_.now() + span); }
    /// Runs until the condition holds, checked every half second, or to the limit; returns the time that it took.
    milliseconds pass_until(const std::function<bool()>& holds, milliseconds limit);

    void kill(std::size_t node);
    void leave(std::size_t node);
    /// Starts another incarnation: another epoch, the same name and address.
    void restart(std::size_t node);
    /// Suspends its process for this time.
    void pause(std::size_t node, std::chrono::microseconds span);
    /// Its clock jumps ahead.
    void jump(std::size_t node, milliseconds ahead);
    /// Messages between two nodes are delivered only if this allows it; empty: always.
    void allow(std::function<bool(std::size_t, std::size_t)> passes) { passes_ = std::move(passes); }
    void set_weather(gossip_weather weather) { weather_ = weather; }

    /// Every running node that has not been paused lately considers every other such node live, in its current
    /// incarnation.
    [[nodiscard]] bool whole() const { return missing() == 0; }
    /// The number of pairs of running nodes that have not been paused lately of which the first does not consider the
    /// second live.
    [[nodiscard]] std::size_t missing() const;
    /// How many nodes consider this one live.
    [[nodiscard]] std::size_t holding(std::size_t node) const { return listing(node, false); }
    /// How many nodes consider it suspect.
    [[nodiscard]] std::size_t suspecting(std::size_t node) const { return listing(node, true); }
    [[nodiscard]] std::size_t clashes() const noexcept { return clashes_; }
    /// Live nodes that another node considered gone, or suspect.
    [[nodiscard]] std::size_t false_deaths() const noexcept { return false_deaths_; }
    [[nodiscard]] std::size_t false_suspicions() const noexcept { return false_suspicions_; }
    void forget_verdicts() noexcept { false_deaths_ = false_suspicions_ = clashes_ = 0; }

    /// Bytes that nodes received since the last call, including IP and TCP headers: the average of all nodes, and the
    /// maximum.
    struct received {
        double average = 0;
        double most = 0;
    };
    received take_received(milliseconds within);

    [[nodiscard]] std::size_t living() const;
    /// The longest queue of unread messages.
    [[nodiscard]] std::size_t deepest_queue() const noexcept { return deepest_queue_; }

  private:
    class member;
    using handler = std::function<void(member&)>;

    /// \param bytes of the message, as far as it may need several packets
    /// \param refused called at the sender if no node runs there
    void send(std::size_t from, std::size_t to, std::size_t bytes, handler arrives, handler refused = {});
    void deliver(time_point when, std::size_t to, handler what);
    [[nodiscard]] bool is_steady(const member& m) const;
    [[nodiscard]] std::size_t listing(std::size_t node, bool suspect) const;
    std::chrono::microseconds delay_by_loss(std::size_t packets);
    void run(member& m, const handler& what = {});
    void wake(member& m);
    void plan_pause(std::size_t node, time_point after);

    dice dice_;
    gossip_weather weather_;
    planted fault_;
    agenda time_;
    std::vector<std::shared_ptr<member>> members_;
    std::map<std::string, std::size_t, std::less<>> by_url_;
    std::vector<std::string> seeds_;
    std::function<bool(std::size_t, std::size_t)> passes_;
    std::size_t false_deaths_ = 0;
    std::size_t false_suspicions_ = 0;
    std::size_t clashes_ = 0;
    std::size_t deepest_queue_ = 0;
    std::uint32_t next_epoch_ = 1;
};

} // namespace cles::simulation
