// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/chrono.hpp>
#include <cles/convert.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/error.hpp>
#include <cles/log.hpp>

#include <boost/system/error_code.hpp>

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace boost::asio {
class any_io_executor;
} // namespace boost::asio

namespace cles {

namespace core {
class call;
} // namespace core

class job_feed;

/// Receives the reply to a request of a job: JSON, or the error and the peer's message.
using answer_callback =
    std::function<void(boost::system::error_code code, std::string_view json, std::string_view message)>;

namespace detail {

class job_feed_control;
struct job_feed_request;
/// Makes a feed of a job in a service. It is an argument, so that only programs whose jobs bind contain that code; null
/// in a plugin.
using job_feed_maker = std::shared_ptr<job_feed_control> (*)(const job_feed_request&);

/// The implementation of a responder: in the service, in the runtime's pool, and in a plugin.
class call_control {
  public:
    virtual ~call_control() = default;
    virtual void done(std::string_view json) = 0;
    virtual void fail(errc code, std::string_view message) = 0;
    /// Replies `busy`, with the delay after which a retry makes sense.
    virtual void refuse(std::string_view message, std::chrono::milliseconds /*retry*/) { fail(errc::busy, message); }
    virtual bool progress(double fraction, std::string_view json) = 0;
    virtual void on_stop(std::function<void()> callback) = 0;
    [[nodiscard]] virtual bool stopped() const noexcept = 0;
    virtual void delegate(std::string_view command, const call_options& options, answer_callback answered) = 0;
    /// For `responder::bind`. \throws cles::error with `failed` if jobs have no feeds here
    virtual std::shared_ptr<job_feed_control> bind(job_feed_maker make, std::string_view noun,
                                                   const bind_options& options);
    virtual void log(log_level level, std::string_view text) = 0;
    virtual void record_times(std::chrono::nanoseconds /*queued*/, std::chrono::nanoseconds /*ran*/) {}
    /// \throws cles::error with `failed` if there is none, as in a plugin
    [[nodiscard]] virtual boost::asio::any_io_executor executor() const;
    /// Whether any thread may use it.
    [[nodiscard]] virtual bool is_thread_safe() const noexcept { return false; }
    /// The call at the node that received the request; null in a plugin. The reference is valid as long as this.
    [[nodiscard]] virtual const std::shared_ptr<core::call>& node_call() const noexcept;
};

/// Replies with the exception: a `cles::error` with its code, anything else with `failed` and a message without file
/// paths.
void fail_with(call_control& call, const std::exception_ptr& thrown);

} // namespace detail

/// Replies to one request, later. Passed to handlers of the form `void(cles::request, cles::responder)`.
///
/// The first call of `done`, `fail` or `refuse` replies. Later calls are ignored, and so are all calls after the
/// request was cancelled or its deadline passed. If the last copy is destroyed without a reply, the reply is `failed`.
///
/// In an application, use it only on the service's executor; copies may be moved between threads. In a plugin, it may
/// be used and destroyed on any thread, and callbacks are called on threads of the runtime.
class responder {
  public:
    explicit responder(std::shared_ptr<detail::call_control> call) noexcept : call_(std::move(call)) {}

    /// Replies with a result: a described struct, a scalar, `json_text`, or nothing. If it cannot be written as JSON
    /// that requesters read, for example text that is not UTF-8, the reply is `failed`.
    template <class T>
    void done(const T& result) const {
        std::string json;
        try {
            json = detail::to_content(result);
        } catch (...) {
            detail::fail_with(*call_, std::current_exception());
            return;
        }
        call_->done(json);
    }
    void done() const { call_->done({}); }
    void fail(errc code, std::string_view message) const { call_->fail(code, message); }
    void fail(const std::exception_ptr& thrown) const { detail::fail_with(*call_, thrown); }
    /// Replies `busy`: the work was not started. `retry` tells the requester when a retry makes sense.
    void refuse(std::string_view message, std::chrono::milliseconds retry) const { call_->refuse(message, retry); }

    /// Reports progress from 0 to 1. False if nobody receives it: none was requested, or the requester is gone. A
    /// fraction below that of an earlier report is raised to it.
    bool progress(double fraction) const { return call_->progress(fraction, "{}"); }
    template <class T>
    bool progress(double fraction, const T& details) const {
        return call_->progress(fraction, cles::to_json(details));
    }

    /// Called once when the requester cancels, its link is lost or the deadline passes; at once if that has already
    /// happened. If the job waits for others (`delegate`), it is called before their requests are cancelled.
    void on_stop(std::function<void()> callback) const { call_->on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept { return call_->stopped(); }

    /// Sends a request on behalf of this job: any command of the language except BIND, such as "PULL car0:speed" or
    /// "DELEGATE any:route {...}". Returns at once, and calls back exactly once, never inside this call. So the job
    /// holds no thread while it waits: keep a copy of the responder in the callback, and reply from there.
    ///
    /// The request has the remaining time of the job, or less if `options` say so. It is cancelled when the job is, or
    /// if the job has already replied, and then completes with `cancelled`. `options.diagnostics` has no effect,
    /// because the callback receives the message.
    void delegate(std::string_view command, const call_options& options, answer_callback answered) const {
        call_->delegate(command, options, std::move(answered));
    }
    void delegate(std::string_view command, answer_callback answered) const {
        call_->delegate(command, {}, std::move(answered));
    }

    /// Binds a noun on behalf of this job, such as "car0:speed", with the rights of this node. Include
    /// <cles/job_feed.hpp>, which explains the result. Returns at once: whether the publisher accepts it, the first
    /// `next` of the feed tells. A job has 64 feeds at most; none of them is bound by multicast.
    [[nodiscard]] job_feed bind(std::string_view noun, const bind_options& options) const;
    [[nodiscard]] job_feed bind(std::string_view noun) const;

    /// Writes to the service's log.
    void log(log_level level, std::string_view text) const { call_->log(level, text); }

    /// For pools of workers: if the request is traced, adds to the time that it has waited for a worker, and to the
    /// time that it has held one. Without any call of this, all the time until the reply counts as the latter.
    void record_times(std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) const {
        call_->record_times(queued, ran);
    }

    /// The service's executor.
    /// \throws cles::error with `failed` in a plugin
    [[nodiscard]] boost::asio::any_io_executor get_executor() const;

    /// Whether it may be used and destroyed on any thread: true for jobs on a pool of workers, and in plugins.
    [[nodiscard]] bool is_thread_safe() const noexcept { return call_->is_thread_safe(); }
    /// For <cles/sharing.hpp> and <cles/jobs.hpp>.
    [[nodiscard]] const std::shared_ptr<core::call>& node_call() const noexcept { return call_->node_call(); }

  private:
    std::shared_ptr<detail::call_control> call_;
};

} // namespace cles
