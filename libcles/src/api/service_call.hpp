// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/responder.hpp>

#include "node/session/call.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::detail {
class engine;
}

namespace cles::api {

/// What a responder holds: the call, and the service that received it. When the last copy is destroyed, the call has
/// been answered one way or another.
class service_call final : public detail::call_control, public std::enable_shared_from_this<service_call> {
  public:
    service_call(std::shared_ptr<core::call> call, boost::asio::any_io_executor executor,
                 std::weak_ptr<detail::engine> service)
        : call_(std::move(call)), executor_(std::move(executor)), service_(std::move(service)) {}
    ~service_call() override;

    void done(std::string_view json) override { call_->done(json); }
    void fail(errc code, std::string_view message) override {
        call_->fail({.code = code, .message = std::string{message}});
    }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override;
    bool progress(double fraction, std::string_view json) override { return call_->progress(fraction, json); }
    void on_stop(std::function<void()> callback) override;
    [[nodiscard]] bool stopped() const noexcept override { return call_->stopped(); }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override;
    void log(log_level level, std::string_view text) override;
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return executor_; }

  private:
    /// Its own requests that are in flight.
    struct asked {
        std::uint64_t last = 0;
        std::map<std::uint64_t, std::uint64_t> tickets; ///< for cancellation
        std::function<void()> then;                     ///< the handler's own stop callback
    };
    void send(detail::engine& by, std::string_view command, const call_options& options, answer_callback answered,
              std::chrono::milliseconds left);
    void answer_later(answer_callback answered, errc why, const char* words);
    /// Wraps the handler's callback so that it is called as user code.
    [[nodiscard]] std::function<void()> put(std::function<void()> callback) const;
    void follow_stop();
    void withdraw_asked();

    std::shared_ptr<core::call> call_;
    boost::asio::any_io_executor executor_;
    std::weak_ptr<detail::engine> service_;
    std::unique_ptr<asked> asked_; ///< from its first request on
};

} // namespace cles::api
