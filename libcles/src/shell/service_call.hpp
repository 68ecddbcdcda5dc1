// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/responder.hpp>

#include "core/call.hpp"
#include "core/handler_failure.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::shell {

/// What a responder holds: the call, and the executor that its service runs on. When the last copy goes, the call has
/// been answered one way or another.
class service_call final : public detail::call_control {
  public:
    service_call(std::shared_ptr<core::call> call, boost::asio::any_io_executor executor)
        : call_(std::move(call)), executor_(std::move(executor)) {}
    ~service_call() override { fail(errc::failed, "the handler ended without an answer"); }

    void done(std::string_view json) override { call_->done(json); }
    void fail(errc code, std::string_view message) override {
        call_->fail({.code = code, .message = std::string{message}});
    }
    bool progress(double fraction, std::string_view json) override { return call_->progress(fraction, json); }
    void on_stop(std::function<void()> callback) override { call_->on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept override { return call_->stopped(); }
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return executor_; }

  private:
    std::shared_ptr<core::call> call_;
    boost::asio::any_io_executor executor_;
};

} // namespace cles::shell
