// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/error.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <chrono>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace cles {
struct registration;
}

namespace cles::runtime {

class job_record;
class delegated_requests;
class job_dispatcher;

/// What a job works with: the request, and the means to answer it.
///
/// A job answers once, on its worker or later, from any thread, even after the pool has ended. A second answer is
/// counted and ignored; one that comes after the requester withdrew is ignored. Each copy of the context keeps the job
/// open. When the last copy is destroyed, and no callback of the job is outstanding, a job without an answer is
/// answered `failed`. All functions may be called from any thread.
class job_context {
  public:
    /// Takes over one reference to the record.
    explicit job_context(job_record& adopted) noexcept : record_(&adopted) {}
    job_context(const job_context& other) noexcept;
    job_context(job_context&& other) noexcept : record_(std::exchange(other.record_, nullptr)) {}
    job_context& operator=(job_context other) noexcept {
        std::swap(record_, other.record_);
        return *this;
    }
    ~job_context();

    /// Valid as long as this context or a copy of it.
    [[nodiscard]] const cles::request& request() const noexcept;
    [[nodiscard]] time_point deadline() const noexcept { return request().deadline(); }
    /// Whether the answer is no longer needed: the request was withdrawn, the link was lost, the time is over, or the
    /// pool ends.
    [[nodiscard]] bool stopped() const noexcept;

    /// Answers with JSON text. Nothing becomes {}, a scalar {"value":x}; invalid JSON becomes `failed`.
    void done(std::string_view json = {}) const;
    void fail(errc code, std::string_view message) const;
    /// Answers `busy`: the work was not begun. The reply says when to retry.
    void refuse(std::string_view message, std::chrono::milliseconds retry) const;
    /// Answers with the code of a `cles::error`; with `failed` for any other exception.
    void fail(const std::exception_ptr& thrown) const;
    /// Reports progress, from 0 to 1, with a JSON object. False if the requester does not want it.
    bool progress(double fraction, std::string_view json = "{}") const;

    /// Calls back once when the job is stopped, on a thread that only makes these calls; or at once, in this thread, if
    /// it has been stopped. The callback should be quick, because others wait for it. A later callback replaces an
    /// earlier one.
    void on_stop(std::function<void()> callback) const;

    /// Sends a request to another node, as `responder::delegate` does. No worker is held while it waits: the callback
    /// runs on a worker as a continuation of this job. The start and the continuations of one job never run at the same
    /// time. The request ends with this job's deadline at the latest, and is withdrawn when the job is stopped. If the
    /// pool ends first, the callback gets `unavailable`; it is dropped without a call only if no worker becomes free
    /// for it in time, because all that are left are in jobs that do not end. (If too many requests are made at once,
    /// it is called with `busy` before this function returns.)
    void delegate(std::string_view command, const call_options& options, answer_callback answered) const;

    /// Writes to the log of the node. Entries that come too fast are dropped and counted.
    void log(log_level level, std::string_view text) const;

    /// The service's executor: what is posted there does not run on a worker.
    [[nodiscard]] boost::asio::any_io_executor executor() const;
    /// The same job as a responder. Unlike a service's own, it may be used from any thread.
    [[nodiscard]] responder as_responder() const;

    /// The fastest way to answer, for work that answers as its last action: the result is what `write(json_writer&)`
    /// writes. Exceptions pass through. The worker has to be the only holder of the job.
    template <class F>
    void answer_last(F&& write) const {
        json_writer writer{result_buffer()};
        std::forward<F>(write)(writer);
        set_result_written();
    }

  private:
    friend job_record;
    friend delegated_requests;
    friend job_dispatcher;
    class control;

    [[nodiscard]] std::string& result_buffer() const;
    void set_result_written() const;

    job_record* record_;
};

/// What the jobs of one task do. It runs on workers, for several jobs at once, and answers through the context, then or
/// later. An exception from it becomes the answer.
using job_work = std::function<void(const job_context&)>;

/// Work that calls the task's handler, which it takes over: one that takes a responder gets the job's.
[[nodiscard]] job_work take_work(registration& task);

/// JSON text that is known to be valid and free of white space, as a result: it is written unchanged.
struct compact_json {
    std::string_view text;
};

} // namespace cles::runtime

template <>
struct cles::converter<cles::runtime::compact_json> {
    static void write(json_writer& w, const runtime::compact_json& value) { w.raw(value.text); }
};
