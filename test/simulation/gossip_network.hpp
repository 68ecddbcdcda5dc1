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

/// What the network between nodes that gossip is like.
struct gossip_weather {
    unsigned loss = 0; ///< of packets, per mille: what they carry comes later
    std::chrono::microseconds quickest{200};
    std::chrono::microseconds slowest{5'000};
    unsigned paused = 0; ///< of each node's time, per mille
    std::chrono::milliseconds shortest_pause{200};
    std::chrono::milliseconds max_pause{10'000};
};

/// Nodes by the hundred or thousand that find each other by seeds and gossip, in virtual time. What decides is the
/// library's own: presence, announcer, gossip, and the tables as text. What is simulated is the links, and what goes
/// wrong.
class gossip_network {
  public:
    using milliseconds = std::chrono::milliseconds;

    explicit gossip_network(std::uint64_t seed, gossip_weather weather = {}, planted fault = planted::none);
    gossip_network(const gossip_network&) = delete;
    gossip_network& operator=(const gossip_network&) = delete;
    ~gossip_network();

    /// Starts nodes within so long, of which the first few are the seeds of all; returns the first one's number.
    std::size_t start(std::size_t count, milliseconds within, std::size_t seeds = 3);
    /// Lets time go by.
    void pass(milliseconds span) { time_.run_until(time_.now() + span); }
    /// Until it holds, looked at every half second, or the limit; how long it took.
    milliseconds pass_until(const std::function<bool()>& holds, milliseconds limit);

    void kill(std::size_t node);
    void leave(std::size_t node);
    /// Begins again: another epoch, the same name and address.
    void restart(std::size_t node);
    /// Its process stands still for so long.
    void pause(std::size_t node, std::chrono::microseconds span);
    /// Its clock goes ahead at once.
    void jump(std::size_t node, milliseconds ahead);
    /// What one node sends to another passes only where this allows it; empty: always.
    void allow(std::function<bool(std::size_t, std::size_t)> passes) { passes_ = std::move(passes); }
    void set_weather(gossip_weather weather) { weather_ = weather; }

    /// Every node that lives, and has not been paused lately, holds every other such for live, in its current run.
    [[nodiscard]] bool whole() const { return missing() == 0; }
    /// Of all pairs of living nodes that have not been paused lately, those of which the first does not hold the second
    /// for live.
    [[nodiscard]] std::size_t missing() const;
    /// How many hold a node for live.
    [[nodiscard]] std::size_t holding(std::size_t node) const { return listing(node, false); }
    /// And for suspect.
    [[nodiscard]] std::size_t suspecting(std::size_t node) const { return listing(node, true); }
    [[nodiscard]] std::size_t clashes() const noexcept { return clashes_; }
    /// Live nodes that somebody took for gone, or for suspect.
    [[nodiscard]] std::size_t false_deaths() const noexcept { return false_deaths_; }
    [[nodiscard]] std::size_t false_suspicions() const noexcept { return false_suspicions_; }
    void forget_verdicts() noexcept { false_deaths_ = false_suspicions_ = clashes_ = 0; }

    /// Bytes that nodes received since this was asked last, IP and TCP headers counted: of all on average, and the
    /// most.
    struct received {
        double average = 0;
        double most = 0;
    };
    received take_received(milliseconds within);

    [[nodiscard]] std::size_t living() const;
    /// The most that waited anywhere to be read.
    [[nodiscard]] std::size_t deepest_queue() const noexcept { return deepest_queue_; }

  private:
    class member;
    struct message;

    void send(std::size_t from, std::size_t to, message what);
    void deliver(time_point when, std::size_t to, message what);
    [[nodiscard]] bool is_steady(const member& m) const;
    [[nodiscard]] std::size_t listing(std::size_t node, bool suspect) const;
    std::chrono::microseconds delay_by_loss(std::size_t packets);
    void run(member& m, message* what = nullptr);
    void wake(member& m);
    void handle(member& m, message& what);
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
