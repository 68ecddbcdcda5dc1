// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/planted.hpp"
#include "simulation/workload/part.hpp"
#include "simulation/world/node_hosts.hpp"
#include "simulation/world/plan.hpp"
#include "simulation/world/witness.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

/// The result of a plan.
struct report {
    std::vector<violation> violations;
    std::uint64_t hash = 0; ///< of all events
    std::uint64_t steps = 0;
    std::uint64_t datagrams = 0;
    std::uint64_t stream_bytes = 0;
    std::uint64_t requests = 0;                    ///< served by nodes
    std::uint64_t updates = 0;                     ///< received by feeds
    double node_seconds = 0;                       ///< simulated while something was planned
    std::map<std::uint32_t, std::string> outcomes; ///< of the requests between nodes, by number: what they ended with

    [[nodiscard]] bool broke(rule which) const noexcept;
};

/// Runs one plan: nodes, their activities, and faults.
class world final : public node_hosts {
  public:
    explicit world(const plan& what, planted fault = planted::none, witness::reader reader = {});
    ~world() { end_all(); }

    report live();

    // For the parts.
    [[nodiscard]] unsigned hosts() const noexcept { return plan_.hosts; }
    [[nodiscard]] static std::string name_of(unsigned host) { return "n" + std::to_string(host); }
    /// The number of incarnations that have started there.
    [[nodiscard]] unsigned runs(unsigned host) const noexcept { return runs_[host]; }
    /// The last time that a node there began to leave with notice.
    struct departure {
        unsigned run = 0;
        time_point begun{};
        time_point until{}; ///< from then on its pending requests are cut short
    };
    [[nodiscard]] const departure& departure_of(unsigned host) { return departures_[host]; }
    /// Starts a second node of that name, on an additional host.
    std::shared_ptr<node_run> begin_namesake(const std::string& name, unsigned host, unsigned run);
    void end_run(node_run& n) override;
    [[nodiscard]] bool has_group() const noexcept { return plan_.group; }
    [[nodiscard]] bool secured() const noexcept { return plan_.secured; }
    [[nodiscard]] std::uint64_t seed() const noexcept { return plan_.seed; }
    void note_outcome(std::uint32_t op, std::string_view what) { report_.outcomes.insert_or_assign(op, what); }
    /// Crashes the node there, and starts another one at once.
    void restart(unsigned host) { crash(host, std::chrono::milliseconds{1}); }

  private:
    void start(unsigned host) override;
    void perform(const action& what);
    void crash(unsigned host, std::chrono::milliseconds down);
    /// Stops the node there.
    void depart(unsigned host, std::chrono::milliseconds down);
    /// Makes the node there leave with notice, within that limit.
    void retire(unsigned host, std::chrono::milliseconds limit, std::chrono::milliseconds down);
    void end_departure_by(node_run& n, std::chrono::milliseconds span, const agenda::action& end);
    void collect(node_run& n);
    [[nodiscard]] std::shared_ptr<node_run> make(const std::string& name, unsigned host, unsigned run);

    const plan& plan_;
    std::vector<unsigned> runs_;
    std::map<unsigned, departure> departures_; // by host
    part_list parts_;
    securing* securing_ = nullptr; // one of them; null without security
    report report_;
};

} // namespace cles::simulation
