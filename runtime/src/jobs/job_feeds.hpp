// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/job_feed.hpp>
#include <cles/responder.hpp>

#include "jobs/job_record.hpp"

#include <boost/system/error_code.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <atomic>
#include <cstdint>
#include <memory>
#include <string_view>

namespace cles::runtime {

class completion_queue;
class worker_pool;

/// The feeds of jobs. They are bound, read and closed on the service's executor; what is read continues the job on a
/// worker. Each callback is called once, by `close` at the latest.
class job_feeds {
  public:
    job_feeds(completion_queue& completions, worker_pool& workers) noexcept
        : completions_(completions), workers_(workers) {}
    job_feeds(const job_feeds&) = delete;
    job_feeds& operator=(const job_feeds&) = delete;
    ~job_feeds() = default;

    // -- on any thread ---------------------------------------------------------------------------------------------
    /// The number of a feed that is about to be opened.
    [[nodiscard]] std::uint64_t new_number() noexcept { return ++last_number_; }
    /// What the job holds of it. It keeps the job, and so the pool.
    [[nodiscard]] std::shared_ptr<detail::job_feed_control> handle_of(std::uint64_t number, job_ptr job);

    // -- on the executor -------------------------------------------------------------------------------------------
    /// \param by the responder of the job; null if its requester waits no more
    void open(std::uint64_t number, const responder* by, std::string_view noun, const bind_options& options);
    /// Ends all feeds with `unavailable`.
    void close();

  private:
    class handle;
    struct open_wait {
        std::uint64_t feed;
        job_ptr job;
        event_callback callback;
    };

    void next(std::uint64_t number, const job_ptr& job, event_callback taken);
    void unbind(std::uint64_t number) noexcept;
    void fetch(std::uint64_t number, const job_ptr& job, event_callback taken);
    void complete(std::uint64_t ticket, boost::system::error_code code, const job_event& event);

    completion_queue& completions_;
    worker_pool& workers_;
    std::atomic<std::uint64_t> last_number_{0};
    boost::unordered_flat_map<std::uint64_t, job_feed> feeds_; // by number
    boost::unordered_flat_map<std::uint64_t, open_wait> waits_;
    std::uint64_t last_ticket_ = 0;
};

} // namespace cles::runtime
