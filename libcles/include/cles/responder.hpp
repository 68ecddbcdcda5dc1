// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/error.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles {

namespace detail {

/// What a responder speaks to; implemented by the service.
class call_control {
  public:
    virtual ~call_control() = default;
    virtual void done(std::string_view json) = 0;
    virtual void fail(errc code, std::string_view message) = 0;
    virtual bool progress(double fraction, std::string_view json) = 0;
    virtual void on_stop(std::function<void()> callback) = 0;
    [[nodiscard]] virtual bool stopped() const noexcept = 0;
    [[nodiscard]] virtual boost::asio::any_io_executor executor() const = 0;
};

/// Answers with what the exception says: a `cles::error` with its code, anything else with `failed` and a message that
/// is free of file paths.
void fail_with(call_control& call, const std::exception_ptr& thrown);

} // namespace detail

/// The right to answer one request, later. Handed to handlers of the form `void(cles::request, cles::responder)`.
///
/// The first of `done` and `fail` answers; what comes after it is ignored, as is all that comes after the requester
/// withdrew or its time ran out. When the last copy goes without having answered, the answer is `failed`. Use it on the
/// service's executor only; copies may be moved between threads.
class responder {
  public:
    explicit responder(std::shared_ptr<detail::call_control> call) noexcept : call_(std::move(call)) {}

    /// Answers with a result: a described struct, a scalar, `json_text`, or nothing.
    template <class T>
    void done(const T& result) {
        call_->done(to_json(result));
    }
    void done() { call_->done({}); }
    void fail(errc code, std::string_view message) { call_->fail(code, message); }
    void fail(const std::exception_ptr& thrown) { detail::fail_with(*call_, thrown); }

    /// Reports how far the work is, from 0 to 1. False where nobody listens: no progress was asked for, or the
    /// requester is gone. A fraction that is lower than one reported earlier counts as that one.
    bool progress(double fraction) { return call_->progress(fraction, "{}"); }
    template <class T>
    bool progress(double fraction, const T& details) {
        return call_->progress(fraction, to_json(details));
    }

    /// Called once when the requester withdraws, its link is lost or the deadline passes; at once where that has
    /// happened.
    void on_stop(std::function<void()> callback) { call_->on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept { return call_->stopped(); }

    [[nodiscard]] boost::asio::any_io_executor get_executor() const { return call_->executor(); }

  private:
    std::shared_ptr<detail::call_control> call_;
};

} // namespace cles
