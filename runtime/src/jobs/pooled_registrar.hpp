// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include "jobs/job_pool.hpp"

#include <memory>

namespace cles::runtime {

/// Registers tasks with a service so that their handlers run on the workers of a pool.
///
/// Handlers that take a responder get one that may be used from any thread. Handlers that are marked `inline_ok`, and
/// coroutines, run on the service's executor, inline. They are timed; one that takes longer than
/// `pool_options::slow_inline` is counted and logged. Handlers may be called by several workers at once.
///
/// To be used on the service's executor. The registrar may be destroyed before its tasks. After the end of the pool
/// they are answered `unavailable`.
class pooled_registrar final : public registrar {
  public:
    pooled_registrar(service& host, job_pool& pool) : host_(host), dispatcher_(pool.dispatcher()) {}

    /// \throws cles::error: `invalid_name`, `already_registered`
    void add(registration task) override;
    [[nodiscard]] publisher make_publisher() override;

  private:
    service& host_;
    std::shared_ptr<job_dispatcher> dispatcher_;
};

} // namespace cles::runtime
