// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include "jobs/job_queue.hpp"
#include "jobs/service_time.hpp"
#include "jobs/worker_watchdog.hpp"
#include "node/session/call.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

namespace cles::simulation {

/// The workers of a daemon, in virtual time. Admission, the order of links and the detection of stuck workers are
/// decided by the classes of runtime/src; this replaces its worker_pool and job_dispatcher, and must be kept consistent
/// with them.
class work_pool final : public std::enable_shared_from_this<work_pool> {
  public:
    static constexpr std::size_t workers = 2;
    static constexpr std::size_t replacements = 1;
    static constexpr std::size_t most_queued = 5;
    static constexpr std::chrono::milliseconds grace{300};

    explicit work_pool(node_run& host);

    struct order {
        std::uint64_t requester = 0;
        std::shared_ptr<core::call> answer;
        std::chrono::milliseconds work{0};
        bool heeds = true; ///< stops when it is told to
        std::function<void()> begun;
    };
    void submit(order what);
    /// Its node has crashed: pending work is discarded.
    void crash();
    [[nodiscard]] node_load load() const noexcept;
    /// Checks that it stays within its limits, and knows stuck workers.
    void check();
    void check_rest();

  private:
    struct job final : runtime::job_queue::item {
        order what;
        std::uint64_t number = 0;
        std::size_t place = 0;
        bool at_work = false;
        bool known_stuck = false;
        time_point begun{};
        time_point due{}; // when it should have ended
    };

    void work();
    void end(std::uint64_t number);
    void stop(std::uint64_t number);
    void watch();
    void complain(rule which, const std::string& what);

    node_run& host_;
    runtime::job_queue queue_;
    runtime::worker_watchdog watch_{workers, replacements, grace};
    runtime::service_time service_time_;
    std::map<std::uint64_t, std::unique_ptr<job>> jobs_; // by number
    std::uint64_t last_number_ = 0;
    std::size_t at_work_ = 0;
    bool watching_ = false;
};

} // namespace cles::simulation
