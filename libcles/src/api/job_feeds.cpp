// SPDX-License-Identifier: BSL-1.0
#include "api/job_feeds.hpp"

#include <cles/feed.hpp>
#include <cles/job_feed.hpp>

#include "api/engine.hpp"
#include "node/base/completion_queue.hpp"
#include "node/node_state.hpp"
#include "node/session/call.hpp"
#include "protocol/request_line.hpp"

#include <boost/asio/post.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace cles {
namespace detail {
namespace {

/// A feed of a job. It delivers one event for each call of `next`, and what the job's callback throws is the job's
/// answer.
class service_job_feed final : public job_feed_control, public std::enable_shared_from_this<service_job_feed> {
  public:
    explicit service_job_feed(const job_feed_request& what) : job_(what.job), executor_(*what.executor) {}

    void bind(const job_feed_request& what) {
        auto options = *what.options;
        options.diagnostics_ = nullptr; // the callback gets the message
        const auto most = options.keep_ != 0 ? options.keep_ : protocol::default_keep;
        control_ = make_feed(what.service, what.noun, options, most);
        control_->start(pending_ptr{new started{shared_from_this()}});
    }
    /// There are no more events, for this reason.
    void end(boost::system::error_code code, std::string_view why) {
        if (!over_) {
            over_.emplace(code, std::string{why});
        }
        control_.reset();
        tell(code, {.text = why});
    }

    void next(event_callback taken) override {
        if (over_) {
            fail_later(std::move(taken), over_->first, over_->second);
        } else if (taken_) {
            fail_later(std::move(taken), errc::busy, "another `next` of this feed is pending");
        } else {
            taken_ = std::move(taken);
            if (bound_) {
                fetch();
            }
        }
    }
    void close() noexcept override {
        if (!over_) {
            over_.emplace(errc::cancelled, "the feed was closed");
            const auto closing = std::exchange(control_, nullptr);
            closing->close(); // what is pending fails soon, and is told
        }
    }

  private:
    /// The BIND.
    class started final : public pending {
      public:
        explicit started(std::shared_ptr<service_job_feed> feed) noexcept : feed_(std::move(feed)) {}
        verdict offer(std::string_view /*json*/) override { // the feed delivers that value
            const std::unique_ptr<started> self{this};
            feed_->on_bound();
            return verdict::completed;
        }
        void fail(boost::system::error_code code, std::string_view message) override {
            const std::unique_ptr<started> self{this};
            feed_->end(code, message);
        }
        void discard() noexcept override {
            const std::unique_ptr<started> self{this};
            feed_->discard();
        }

      private:
        std::shared_ptr<service_job_feed> feed_;
    };

    /// The event that a call of `next` waits for.
    class awaited final : public pending_event {
      public:
        explicit awaited(std::shared_ptr<service_job_feed> feed) noexcept : feed_(std::move(feed)) {}
        bool deliver(const raw_event& event) override {
            if (!event.has_json()) {
                return false;
            }
            const std::unique_ptr<awaited> self{this};
            feed_->tell({}, {.kind = event.kind,
                             .json = event.body,
                             .publisher = event.publisher,
                             .seq = event.seq,
                             .epoch = event.epoch,
                             .missed = event.missed,
                             .text = event.text});
            return true;
        }
        void fail(boost::system::error_code code, std::string_view message) override {
            const std::unique_ptr<awaited> self{this};
            feed_->end(code, message);
        }
        void discard() noexcept override {
            const std::unique_ptr<awaited> self{this};
            feed_->discard();
        }

      private:
        std::shared_ptr<service_job_feed> feed_;
    };

    void on_bound() {
        bound_ = true;
        if (over_) { // it was closed meanwhile
            tell(over_->first, {.text = over_->second});
        } else if (taken_) {
            fetch();
        }
    }
    // The loop has ended, and nothing is told any more. A callback may own this feed, and this feed owns the callback.
    void discard() noexcept {
        const auto taken = std::exchange(taken_, nullptr);
        const auto control = std::exchange(control_, nullptr);
        if (!over_) {
            over_.emplace(errc::cancelled, std::string{});
        }
    }
    void fetch() { control_->next(event_ptr{new awaited{shared_from_this()}}); }

    // Tells who waits, if anybody does.
    void tell(boost::system::error_code code, const job_event& event) {
        if (const auto taken = std::exchange(taken_, nullptr)) {
            call(taken, code, event);
        }
    }
    void call(const event_callback& taken, boost::system::error_code code, const job_event& event) const {
        try {
            taken(code, event);
        } catch (...) {
            if (const auto job = job_.lock()) {
                fail_with(*job, std::current_exception());
            }
        }
    }
    void fail_later(event_callback taken, boost::system::error_code code, std::string why) {
        boost::asio::post(executor_, [self = shared_from_this(), taken = std::move(taken), code, why = std::move(why)] {
            self->call(taken, code, {.text = why});
        });
    }

    std::weak_ptr<call_control> job_;
    boost::asio::any_io_executor executor_;
    std::shared_ptr<feed_control> control_; // null: it has ended
    event_callback taken_;                  // null: nobody waits
    bool bound_ = false;
    std::optional<std::pair<boost::system::error_code, std::string>> over_;
};

class feeds_of_job final : public job_feed_list, public std::enable_shared_from_this<feeds_of_job> {
  public:
    static constexpr std::size_t most = 64;

    void close() noexcept override {
        for (const auto& each : std::exchange(all_, {})) {
            if (const auto open = each.lock()) {
                open->close();
            }
        }
    }
    void close_soon(const core::call& of) override {
        of.host()->completions.call([self = shared_from_this()] { self->close(); });
    }
    /// False if there are too many.
    bool add(const std::shared_ptr<job_feed_control>& made) {
        std::erase_if(all_, [](const auto& feed) { return feed.expired(); });
        if (all_.size() >= most) {
            return false;
        }
        all_.push_back(made);
        return true;
    }

  private:
    std::vector<std::weak_ptr<job_feed_control>> all_;
};

feeds_of_job& feeds_in(std::shared_ptr<job_feed_list>& place) {
    if (!place) {
        place = std::make_shared<feeds_of_job>();
    }
    return static_cast<feeds_of_job&>(*place); // made here only
}

std::shared_ptr<job_feed_control> make_job_feed(const job_feed_request& what) {
    auto made = std::make_shared<service_job_feed>(what);
    if (!what.service || what.service->stopped()) {
        made->end(errc::stopped, "the service has been stopped");
    } else if (what.ended) {
        made->end(errc::cancelled, "the job has already ended");
    } else if (what.options->multicast_) {
        made->end(errc::invalid_option, "bind_options::multicast is not for the feed of a job");
    } else if (!feeds_in(*what.feeds).add(made)) {
        made->end(errc::busy, "a job has 64 feeds at most");
    } else {
        made->bind(what);
    }
    return made;
}

} // namespace
} // namespace detail

job_feed responder::bind(std::string_view noun, const bind_options& options) const {
    return job_feed{call_->bind(&detail::make_job_feed, noun, options)};
}

job_feed responder::bind(std::string_view noun) const { return bind(noun, {}); }

} // namespace cles
