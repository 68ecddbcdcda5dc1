// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_feeds.hpp"

#include <cles/error.hpp>
#include <cles/limits.hpp>

#include "jobs/completion_queue.hpp"
#include "jobs/worker_pool.hpp"

#include <chrono>
#include <string>
#include <utility>

namespace cles::runtime {
namespace {

using clock = time_point::clock;

/// An event that owns its texts, on its way to a worker.
class travelling_event {
  public:
    explicit travelling_event(const job_event& what)
        : what_(what), json_(what.json), publisher_(what.publisher), text_(what.text) {}

    /// Valid as long as this.
    [[nodiscard]] job_event arrived() const {
        auto out = what_;
        out.json = json_;
        out.publisher = publisher_;
        out.text = text_;
        out.waited = clock::now() - begun_;
        return out;
    }

  private:
    job_event what_;
    std::string json_;
    std::string publisher_;
    std::string text_;
    time_point begun_ = clock::now();
};

} // namespace

class job_feeds::handle final : public detail::job_feed_control {
  public:
    handle(job_feeds& owner, std::uint64_t number, job_ptr job) noexcept
        : owner_(owner), number_(number), job_(std::move(job)) {}
    void next(event_callback taken) override { owner_.next(number_, job_, std::move(taken)); }
    void close() noexcept override { owner_.unbind(number_); }

  private:
    job_feeds& owner_;
    const std::uint64_t number_;
    const job_ptr job_;
};

// -- on any thread -------------------------------------------------------------------------------------------------

std::shared_ptr<detail::job_feed_control> job_feeds::handle_of(std::uint64_t number, job_ptr job) {
    return std::make_shared<handle>(*this, number, std::move(job));
}

void job_feeds::next(std::uint64_t number, const job_ptr& job, event_callback taken) {
    const auto callback = std::make_shared<event_callback>(std::move(taken));
    if (completions_.post_always([this, number, job, callback] { fetch(number, job, std::move(*callback)); })) {
        return;
    }
    const auto refuse = [callback] { (*callback)(errc::unavailable, {.text = "the node is stopping"}); };
    if (!workers_.schedule(*job, refuse)) {
        refuse(); // no worker is left
    }
}

void job_feeds::unbind(std::uint64_t number) noexcept {
    static_cast<void>(completions_.post_always([this, number] { feeds_.erase(number); }));
}

// -- on the executor -----------------------------------------------------------------------------------------------

void job_feeds::open(std::uint64_t number, const responder* by, std::string_view noun, const bind_options& options) {
    if (by != nullptr) {
        feeds_.emplace(number, by->bind(noun, options));
    }
}

void job_feeds::fetch(std::uint64_t number, const job_ptr& job, event_callback taken) {
    const auto ticket = ++last_ticket_;
    waits_.emplace(ticket, open_wait{number, job, std::move(taken)});
    const auto found = feeds_.find(number);
    if (found == feeds_.end()) {
        complete(ticket, errc::cancelled, {.text = "the feed is closed"});
        return;
    }
    // The job keeps this alive, even if the event comes after `close`.
    const auto feed = found->second;
    feed.next(
        [this, job, ticket](boost::system::error_code code, const job_event& event) { complete(ticket, code, event); });
}

void job_feeds::complete(std::uint64_t ticket, boost::system::error_code code, const job_event& event) {
    const auto found = waits_.find(ticket);
    if (found == waits_.end()) {
        return;
    }
    auto done = std::move(found->second);
    waits_.erase(found);
    if (code && code != errc::busy) {
        feeds_.erase(done.feed);
    }
    workers_.schedule(*done.job, [callback = std::move(done.callback), code, event = travelling_event{event}] {
        callback(code, event.arrived());
    });
}

void job_feeds::close() {
    while (!waits_.empty()) {
        complete(waits_.begin()->first, errc::unavailable, {.text = "the node is stopping"});
    }
    feeds_.clear();
}

} // namespace cles::runtime
