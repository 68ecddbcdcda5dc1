// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/support/child_process.hpp"
#include "perf/support/handler_style.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/localization.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>

#include <chrono>
#include <cstddef>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

/// PULL of the localization packet by the library, at both ends.
namespace cles::perf {

/// Registers the task that is pulled.
void register_localization(cles::registrar& tasks);

/// A node that serves it. Does not return.
void serve_localization(std::string_view url, const run_options& how, const child_process::announce& announce);

/// Keeps a number of PULLs in flight from one client.
class pull_load {
  public:
    /// \pre the client can reach the node of `noun`
    pull_load(boost::asio::io_context& io, cles::service& client, std::string noun, handler_style style,
              bool check_samples, run_options how = {});
    /// Whether the requests that follow are urgent.
    void ask_urgently(bool urgent) { urgent_ = urgent ? &urgent_options : nullptr; }

    /// Runs until the recorder is full or the time is over. A request counts when its result, as a C++ value, has
    /// reached the caller's code. Returns how long the counted requests took. \throws the error of the first request
    /// that fails
    std::chrono::nanoseconds run(std::size_t in_flight, std::chrono::nanoseconds at_most, latency_recorder& record);

  private:
    using clock = std::chrono::steady_clock;
    struct lane {
        clock::time_point began;
    };

    static const call_options urgent_options;

    void ask(lane& from);
    boost::asio::awaitable<void> ask_on_and_on(clock::time_point began);
    /// Records a result; false if it was the last one.
    bool arrived(const localization& value, clock::time_point& began);
    void lane_ended(std::exception_ptr failure);

    boost::asio::io_context& io_;
    cles::service& client_;
    std::string noun_;
    handler_style style_;
    bool check_samples_;
    run_options how_;
    const call_options* urgent_ = nullptr;

    latency_recorder* record_ = nullptr;
    clock::time_point until_;
    clock::time_point last_;
    bool over_ = false;
    std::vector<lane> lanes_;
    std::size_t lanes_running_ = 0;
    std::exception_ptr failure_;
};

} // namespace cles::perf
