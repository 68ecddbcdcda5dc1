// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/world/ledger.hpp"
#include "simulation/world/node_hosts.hpp"
#include "simulation/world/work_pool.hpp"
#include "simulation/world/work_report.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace cles::simulation {

/// Hosts on some of which nodes run jobs, as daemons do, and the requests of clients for these jobs.
class daemon_hosts : public node_hosts {
  protected:
    daemon_hosts(std::uint64_t seed, planted fault, std::size_t most_queued)
        : node_hosts(seed, fault), pool_{.most_queued = most_queued} {}
    ~daemon_hosts() { end_all(); }

    /// Gives a new node its workers. \param shares they share their jobs with those of other nodes
    void add_pool(node_run& n, bool shares) { add_pool(n, shares, pool_); }
    void add_pool(node_run& n, bool shares, const work_pool::options& how);
    /// The workers run that task, whose parameters begin with the number of the request and its work in milliseconds.
    void offer(node_run& n, verb how, const std::string& task, bool idempotent);
    /// How the pool is to run a request, except for what all requests have in common.
    [[nodiscard]] virtual work_pool::order order_of(const request& r, std::uint32_t op) = 0;
    [[nodiscard]] work_pool& pool_of(unsigned host) const { return *pools_.at(host); }
    void end_run(node_run& n) override;
    void check(node_run& n) override;
    /// Adds what the pool of that node has done to the report.
    void count(node_run& n);

    ledger requests_{watcher_, time_};
    work_report report_;
    idle_meter idle_{time_};

  private:
    const work_pool::options pool_; // of each node
    std::map<unsigned, std::shared_ptr<work_pool>> pools_;
    std::shared_ptr<core::call> kept_; // by a planted fault
};

} // namespace cles::simulation
