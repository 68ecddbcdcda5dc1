// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/log.hpp>

#include <boost/system/error_code.hpp>

#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace boost::asio {
class any_io_executor;
} // namespace boost::asio

namespace cles {

/// Told the answer to a request that a job sent: JSON, or why there is none and the peer's own words.
using answer_callback =
    std::function<void(boost::system::error_code code, std::string_view json, std::string_view message)>;

namespace detail {

/// What a responder speaks to; implemented by the service, by the runtime's pool, and inside a plugin.
class call_control {
  public:
    virtual ~call_control() = default;
    virtual void done(std::string_view json) = 0;
    virtual void fail(errc code, std::string_view message) = 0;
    /// `busy`, with when it is worth asking again.
    virtual void refuse(std::string_view message, std::chrono::milliseconds /*retry*/) { fail(errc::busy, message); }
    virtual bool progress(double fraction, std::string_view json) = 0;
    virtual void on_stop(std::function<void()> callback) = 0;
    [[nodiscard]] virtual bool stopped() const noexcept = 0;
    virtual void delegate(std::string_view command, const call_options& options, answer_callback answered) = 0;
    virtual void log(log_level level, std::string_view text) = 0;
    /// \throws cles::error with `failed` where there is none, as in a plugin
    [[nodiscard]] virtual boost::asio::any_io_executor executor() const;
    /// Whether any thread may use it.
    [[nodiscard]] virtual bool is_thread_safe() const noexcept { return false; }
};

/// Answers with what the exception says: a `cles::error` with its code, anything else with `failed` and a message that
/// is free of file paths.
void fail_with(call_control& call, const std::exception_ptr& thrown);

} // namespace detail

/// The right to answer one request, later. Handed to handlers of the form `void(cles::request, cles::responder)`.
///
/// The first of `done` and `fail` answers; what comes after it is ignored, as is all that comes after the requester
/// withdrew or its time ran out. When the last copy goes without having answered, the answer is `failed`.
///
/// In an application use it on the service's executor only; copies may be moved between threads. In a plugin it may be
/// used, and let go of, on any thread, and callbacks come from threads of the runtime.
class responder {
  public:
    explicit responder(std::shared_ptr<detail::call_control> call) noexcept : call_(std::move(call)) {}

    /// Answers with a result: a described struct, a scalar, `json_text`, or nothing. What cannot be written, as text
    /// that is not UTF-8, is answered `failed`.
    template <class T>
    void done(const T& result) const {
        std::string json;
        try {
            json = to_json(result);
        } catch (...) {
            detail::fail_with(*call_, std::current_exception());
            return;
        }
        call_->done(json);
    }
    void done() const { call_->done({}); }
    void fail(errc code, std::string_view message) const { call_->fail(code, message); }
    void fail(const std::exception_ptr& thrown) const { detail::fail_with(*call_, thrown); }
    /// Answers `busy`: the work was not begun. The requester is told when it is worth asking again.
    void refuse(std::string_view message, std::chrono::milliseconds retry) const { call_->refuse(message, retry); }

    /// Reports how far the work is, from 0 to 1. False where nobody listens: no progress was asked for, or the
    /// requester is gone. A fraction that is lower than one reported earlier counts as that one.
    bool progress(double fraction) const { return call_->progress(fraction, "{}"); }
    template <class T>
    bool progress(double fraction, const T& details) const {
        return call_->progress(fraction, to_json(details));
    }

    /// Called once when the requester withdraws, its link is lost or the deadline passes; at once where that has
    /// happened. Where the job waits for others (`delegate`), this comes before what it asked is withdrawn.
    void on_stop(std::function<void()> callback) const { call_->on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept { return call_->stopped(); }

    /// Asks others on behalf of this job: any command of the language but BIND, as "PULL car0:speed" or
    /// "DELEGATE any:route {...}". Returns at once, and calls back once, always later, so that the job holds no thread
    /// while it waits: keep a copy of the responder in the callback and answer from there.
    ///
    /// The request has what is left of the job's own time, or less where `options` say so, and is withdrawn when the
    /// job is; it then ends with `cancelled`, and so does one of a job that has been answered. Of the options,
    /// `diagnostics` has no effect: the callback is told.
    void delegate(std::string_view command, const call_options& options, answer_callback answered) const {
        call_->delegate(command, options, std::move(answered));
    }
    void delegate(std::string_view command, answer_callback answered) const {
        call_->delegate(command, {}, std::move(answered));
    }

    /// Tells the service's log.
    void log(log_level level, std::string_view text) const { call_->log(level, text); }

    /// The service's executor. There is none in a plugin.
    /// \throws cles::error with `failed` in a plugin
    [[nodiscard]] boost::asio::any_io_executor get_executor() const;

    /// Whether it may be used, and let go of, on any thread: that of a job on a pool of workers, or in a plugin.
    [[nodiscard]] bool is_thread_safe() const noexcept { return call_->is_thread_safe(); }

  private:
    std::shared_ptr<detail::call_control> call_;
};

} // namespace cles
