// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>
#include <cles/sharing.hpp>

#include "jobs/job_queue.hpp"
#include "jobs/service_time.hpp"
#include "jobs/worker_watchdog.hpp"
#include "node/session/call.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/world/idle_meter.hpp"
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
/// decided by the classes of runtime/src, and which jobs move to other nodes by those of libcles; this replaces
/// worker_pool and job_dispatcher of the runtime, and must be kept consistent with them.
class work_pool final : public std::enable_shared_from_this<work_pool>, private shareable_queue {
  public:
    static constexpr std::size_t replacements = 1;
    static constexpr std::chrono::milliseconds grace{300};

    struct options {
        std::size_t workers = 2;
        std::size_t most_queued = 5; ///< how many jobs may wait
        /// A worker becomes free some time after its job has been answered, as a thread does.
        bool lingers = false;
    };
    /// \param meter learns how many workers are idle while jobs wait; null: nobody does
    work_pool(node_run& host, const options& how, idle_meter* meter = nullptr);

    struct order {
        std::uint64_t requester = 0;
        std::shared_ptr<core::call> answer;
        std::string task{};
        std::chrono::milliseconds work{0};
        bool heeds = true; ///< stops when it is told to
        std::string body{};
        std::function<void()> begun;
    };
    void submit(order what);
    /// Shares its jobs with other nodes from now on.
    void share();
    /// Admits no more jobs, and calls back when all have ended. At the limit, those that are left fail.
    void drain(std::chrono::milliseconds limit, std::function<void()> done);
    /// Its node crashes: pending work is discarded.
    void crash();
    [[nodiscard]] node_load load() const noexcept;
    [[nodiscard]] bool draining() const noexcept { return draining_; }
    /// The jobs that have been sent to other nodes, and those of them that have returned.
    [[nodiscard]] std::size_t sent() const noexcept { return sent_; }
    [[nodiscard]] std::size_t returned() const noexcept { return returned_; }
    /// Checks that it stays within its limits, and knows stuck workers.
    void check();
    void check_rest();

  private:
    struct job final : runtime::job_queue::item {
        order what;
        std::uint64_t number = 0;
        std::size_t place = 0;
        std::uint64_t moved = 0; // the ticket, while another node has it
        bool returned = false;   // another node has refused it
        bool at_work = false;
        bool known_stuck = false;
        time_point begun{};
        time_point due{}; // when it should have ended
    };

    void work();
    void end(std::uint64_t number);
    void free_worker(std::size_t place);
    [[nodiscard]] std::size_t idle() const noexcept;
    void update_meter();
    void stop(std::uint64_t number);
    void watch();
    void fail_open_jobs();
    void update_drain(bool at_limit);
    void report_change();
    [[nodiscard]] state read_state() const override;
    void offer(job_taker& to) override;
    void end_move(std::uint64_t number, bool refused);
    void check_granted(const order& what);
    void complain(rule which, const std::string& what);

    node_run& host_;
    const options how_;
    idle_meter* const meter_;
    idle_meter::figures metered_;
    dice chance_;
    runtime::job_queue queue_;
    runtime::worker_watchdog watch_;
    runtime::service_time service_time_;
    std::map<std::string, runtime::service_time, std::less<>> service_times_; // by task
    time_point last_begin_{};                                                 // of a job
    std::map<std::uint64_t, std::unique_ptr<job>> jobs_;                      // by number
    std::uint64_t last_number_ = 0;
    std::size_t at_work_ = 0;
    std::size_t sent_ = 0;
    std::size_t returned_ = 0;
    std::unique_ptr<job_sharing> sharing_; // null: jobs stay
    std::function<void()> on_drained_;     // null: it is not being drained, or has been
    bool draining_ = false;
    bool watching_ = false;
    bool burst_end_posted_ = false;
};

} // namespace cles::simulation
