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

namespace cles::runtime {

class job_record;
class onward_requests;
class pool_state;

/// What a job sees of the world: what was asked, and how to answer.
///
/// A job answers once, on its worker or later, from any thread, also after the pool has ended; a second answer is
/// counted and ignored, and one that comes after the requester withdrew is ignored. A copy keeps the job open. When the
/// last one goes and nothing that the job started is still to call back, a job without an answer is answered `failed`.
/// All functions may be called from any thread.
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
    /// Whether nobody waits for the answer any more: withdrawn, the link lost, the time over, the pool at its end.
    [[nodiscard]] bool stopped() const noexcept;

    /// Answers with JSON text; nothing becomes {}, a scalar {"value":x}. What is not JSON becomes `failed`.
    void done(std::string_view json = {}) const;
    void fail(errc code, std::string_view message) const;
    /// Answers `busy`: the work was not begun. The requester is told when it is worth asking again.
    void refuse(std::string_view message, std::chrono::milliseconds retry) const;
    /// A `cles::error` with its code, anything else `failed`.
    void fail(const std::exception_ptr& thrown) const;
    /// Tells how far it is, from 0 to 1, with a JSON object. False where nobody listens.
    bool progress(double fraction, std::string_view json = "{}") const;

    /// Called once when the job is stopped, on a thread that serves these calls alone; at once, in this thread, where
    /// it has been. It should be quick: others wait for it. The last one counts.
    void on_stop(std::function<void()> callback) const;

    /// Asks another node, as `responder::delegate` does, and holds no worker while it waits: the callback runs on a
    /// worker as a part of this job. Callbacks of one job run neither at the same time as each other nor as the job's
    /// beginning. The request has no longer than this job, and is withdrawn when it is stopped. Where the pool ends
    /// first, the callback is told `unavailable`; it is only then dropped uncalled where no worker is free for it in
    /// time, since those that are left are in jobs that do not end. (Where too much is asked at once, it is called with
    /// `busy` before this returns.)
    void delegate(std::string_view command, const call_options& options, answer_callback answered) const;

    /// For the log of the node. Where it comes too fast, some is dropped and counted.
    void log(log_level level, std::string_view text) const;

    /// The service's: what is posted there is not on a worker.
    [[nodiscard]] boost::asio::any_io_executor executor() const;
    /// The same as a responder, which, unlike a service's own, may be used from any thread.
    [[nodiscard]] responder as_responder() const;

    /// The quickest way to answer, for work that does so last: what `write(json_writer&)` writes. What it throws passes
    /// through. The worker has to be the only one who holds the job.
    template <class F>
    void answer_last(F&& write) const {
        json_writer writer{room_for_result()};
        std::forward<F>(write)(writer);
        written();
    }

  private:
    friend job_record;
    friend onward_requests;
    friend pool_state;

    [[nodiscard]] std::string& room_for_result() const;
    void written() const;

    job_record* record_;
};

/// What the jobs of one task do. It runs on a worker, on several at once for several jobs, and answers through the
/// context, then or later. What it throws becomes the answer.
using job_work = std::function<void(const job_context&)>;

} // namespace cles::runtime
