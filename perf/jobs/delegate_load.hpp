// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/support/latency_recorder.hpp"

#include <boost/asio/io_context.hpp>

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

namespace cles::perf {

/// Keeps a number of DELEGATEs with an empty body in flight from one client.
class delegate_load {
  public:
    /// `how` the client's loop runs. \pre the client can reach the node of `noun`
    delegate_load(boost::asio::io_context& io, cles::service& client, std::string noun, const run_options& how);

    /// Runs until the recorder is full. Returns how long that took.
    /// \throws cles::error of the first request that fails; the client cannot be used afterwards
    std::chrono::nanoseconds run(std::size_t in_flight, latency_recorder& record);

  private:
    using clock = std::chrono::steady_clock;

    void ask(clock::time_point& begun);

    boost::asio::io_context& io_;
    cles::service& client_;
    std::string noun_;
    run_options how_;
    latency_recorder* record_ = nullptr;
    std::vector<clock::time_point> begun_;
    std::size_t to_send_ = 0;
    std::size_t open_ = 0;
    boost::system::error_code failure_;
};

} // namespace cles::perf
