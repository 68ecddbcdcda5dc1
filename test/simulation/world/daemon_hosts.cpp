// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/daemon_hosts.hpp"

#include <chrono>
#include <utility>

namespace cles::simulation {

void daemon_hosts::add_pool(node_run& n, bool shares, const work_pool::options& how) {
    auto& pool = pools_[n.host()];
    pool = std::make_shared<work_pool>(n, how, &idle_);
    if (shares) {
        pool->share();
    }
}

void daemon_hosts::offer(node_run& n, verb how, const std::string& task, bool idempotent) {
    const auto start = [this, task, pool = pools_.at(n.host())](const request& r,
                                                                const std::shared_ptr<core::call>& c) {
        const auto op = r.parameter<std::uint32_t>(0);
        if (fault() == planted::call_kept && kept_ == nullptr) {
            kept_ = c;
        }
        auto what = order_of(r, op);
        what.answer = c;
        what.task = task;
        what.work = std::chrono::milliseconds{r.parameter<unsigned>(1)};
        what.begun = [this, op] { requests_.note_run(op); };
        pool->submit(std::move(what));
    };
    n.node()->tasks.add(how, task, {.info = {.idempotent = idempotent}, .start = start});
}

void daemon_hosts::end_run(node_run& n) {
    if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
        count(n);
        pool->second->crash();
    }
    n.crash();
}

void daemon_hosts::check(node_run& n) {
    node_hosts::check(n);
    if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
        pool->second->check();
    }
}

void daemon_hosts::count(node_run& n) {
    const auto& pool = pool_of(n.host());
    report_.moved += pool.sent() - pool.returned();
    report_.returned += pool.returned();
    report_.grants += n.node()->counts.grants_sent;
}

} // namespace cles::simulation
