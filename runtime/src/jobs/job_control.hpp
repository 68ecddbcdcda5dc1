// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/responder.hpp>

#include "jobs/job_context.hpp"

#include <chrono>
#include <utility>

namespace cles::runtime {

/// A job as what a responder speaks to.
class job_control final : public detail::call_control {
  public:
    explicit job_control(job_context job) noexcept : job_(std::move(job)) {}

    void done(std::string_view json) override { job_.done(json); }
    void fail(errc code, std::string_view message) override { job_.fail(code, message); }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override { job_.refuse(message, retry); }
    bool progress(double fraction, std::string_view json) override { return job_.progress(fraction, json); }
    void on_stop(std::function<void()> callback) override { job_.on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept override { return job_.stopped(); }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        job_.delegate(command, options, std::move(answered));
    }
    void log(log_level level, std::string_view text) override { job_.log(level, text); }
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return job_.executor(); }
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

  private:
    job_context job_;
};

} // namespace cles::runtime
