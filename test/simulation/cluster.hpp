// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "simulation/network/network.hpp"
#include "simulation/world/node_run.hpp"
#include "simulation/world/work_pool.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

/// One node that routes, three that work for it as daemons do, and a client that asks for `any` and `all`, in virtual
/// time. Workers and the router crash, stop and begin again, their clocks jump, and links and ways are cut, in one
/// direction too.
class cluster {
  public:
    explicit cluster(std::uint64_t seed, planted fault = planted::none);
    cluster(const cluster&) = delete;
    cluster& operator=(const cluster&) = delete;
    ~cluster();

    /// A whole life: trouble, then calm, in which requests have to succeed, then silence.
    void live(std::chrono::seconds trouble);

    [[nodiscard]] const std::vector<violation>& violations() const noexcept { return watcher_.violations(); }
    [[nodiscard]] std::size_t succeeded() const noexcept { return succeeded_; }
    [[nodiscard]] std::size_t failed() const noexcept { return failed_; }
    [[nodiscard]] std::size_t refused() const noexcept { return refused_; }

  private:
    class answer;
    struct asked {
        bool may_repeat = false;
        bool vital = false; ///< has to succeed, or to be refused because all are busy
        time_point deadline{};
        int ends = 0;
        bool succeeded = false;
        errc code{};
        int ran = 0; ///< how many times, anywhere
    };

    void start(unsigned host);
    void offer(node_run& n, const std::shared_ptr<work_pool>& pool);
    void end_run(node_run& n);
    void crash(unsigned host);
    void go_wrong();
    void cut_a_way();
    void ask(bool vital);
    void calm();
    void pass(std::chrono::milliseconds span) { time_.run_until(time_.now() + span); }
    void check_bounds();
    void judge_requests();
    void judge_neighbours();
    void judge_rest();
    asked& end_of(std::uint32_t op);

    planted fault_;
    agenda time_;
    witness watcher_{time_};
    dice chance_;
    network net_;
    std::map<unsigned, std::shared_ptr<node_run>> nodes_;
    std::map<unsigned, std::shared_ptr<work_pool>> pools_;
    std::map<std::uint32_t, asked> asked_;
    std::vector<std::shared_ptr<core::call>> kept_; // by a planted fault
    std::uint32_t last_op_ = 0;
    unsigned runs_ = 0;
    std::size_t succeeded_ = 0;
    std::size_t failed_ = 0;
    std::size_t refused_ = 0;
};

} // namespace cles::simulation
