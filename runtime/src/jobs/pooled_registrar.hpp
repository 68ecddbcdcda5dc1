// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>
#include <cles/task_info.hpp>
#include <cles/verb.hpp>

#include "jobs/job_pool.hpp"

#include <string>

namespace cles::runtime {

/// Registers tasks with a service so that their handlers run on the workers of a pool.
///
/// A handler that takes a responder gets one that may be used from any thread. On the service's executor, and thus in
/// line with all that the node does, run: handlers that are marked `inline_ok`, and coroutines, which belong there.
/// They are timed; one that takes longer than `pool_options::slow_inline` is counted and told of. Handlers may be
/// called by several workers at once.
///
/// To be used on the service's executor. The registrar need not outlive its tasks; after the pool has gone they are
/// answered `unavailable`.
class pooled_registrar final : public registrar {
  public:
    pooled_registrar(service& host, job_pool& pool) : host_(host), state_(pool.state()) {}

    /// \throws cles::error: `invalid_name`, `already_registered`
    void add(registration task) override;
    [[nodiscard]] publisher make_publisher() override;
    /// The same for work that takes the context itself.
    /// \throws cles::error: `invalid_name`, `already_registered`
    void add_work(cles::verb verb, std::string task, task_info info, job_work work);

  private:
    void add_inline(registration task);

    service& host_;
    std::shared_ptr<pool_state> state_;
};

} // namespace cles::runtime
