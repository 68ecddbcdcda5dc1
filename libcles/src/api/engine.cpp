// SPDX-License-Identifier: BSL-1.0
#include "api/engine.hpp"

#include <cles/reply_operation.hpp>
#include <cles/responder.hpp>

#include "api/job_feeds.hpp"
#include "node/session/call.hpp"
#include "transport/member_handler.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::detail {
namespace {

core::local_node_options options_of(service_options&& all, asio_port::asio_environment& by) {
    core::local_node_options result{.node = {.name = std::move(all.name),
                                             .pool = std::move(all.pool),
                                             .epoch = by.random(),
                                             .bounds = all.limits,
                                             .authorise = std::move(all.authorise),
                                             .tracing = all.tracing,
                                             .types = all.types,
                                             .jobs = all.jobs,
                                             .log = std::move(all.log),
                                             .metrics = std::move(all.metrics),
                                             .load = std::move(all.load)},
                                    .peers = std::move(all.peers),
                                    .insecure = all.insecure,
                                    .networks = std::move(all.networks),
                                    .multicast = std::move(all.multicast),
                                    .gossip = std::move(all.gossip),
                                    .on_name_taken = std::move(all.on_name_taken),
                                    .routing = all.routing};
    if (all.security) {
        all.security(by, result.node);
    }
    if (all.federation) {
        all.federation(by, result.node);
    }
    return result;
}

/// What a responder holds: the call, and the service that received it. When the last copy is destroyed, the call has
/// been answered one way or another.
class service_call final : public call_control, public std::enable_shared_from_this<service_call> {
  public:
    service_call(std::shared_ptr<core::call> call, boost::asio::any_io_executor executor,
                 std::weak_ptr<core::local_node> service)
        : call_(std::move(call)), executor_(std::move(executor)), service_(std::move(service)) {}
    ~service_call() override {
        if (asked_) {
            call_->forget_on_stop(); // it refers to this object
        }
        close_feeds();
        if (call_->ended()) {
            return;
        }
        if (const auto by = std::static_pointer_cast<engine>(service_.lock()); by && by->belongs_to_parent()) {
            engine::keep(std::move(call_));
        } else {
            fail(errc::failed, "the handler ended without an answer");
        }
    }

    void done(std::string_view json) override {
        call_->done(json);
        close_feeds();
    }
    void fail(errc code, std::string_view message) override {
        call_->fail({.code = code, .message = std::string{message}});
        close_feeds();
    }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override {
        constexpr std::chrono::milliseconds::rep most = 86'400'000; // a day, as for plugins
        const auto ms = std::clamp<std::chrono::milliseconds::rep>(retry.count(), 0, most);
        call_->fail({.code = errc::busy, .message = std::string{message}, .retry_ms = static_cast<std::uint64_t>(ms)});
        close_feeds();
    }
    bool progress(double fraction, std::string_view json) override { return call_->progress(fraction, json); }
    void on_stop(std::function<void()> callback) override {
        if (call_->stopped()) {
            callback();
        } else if (asked_) {
            asked_->then = put(std::move(callback));
        } else {
            call_->on_stop(put(std::move(callback)));
        }
    }
    [[nodiscard]] bool stopped() const noexcept override { return call_->stopped(); }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        const auto by = service_.lock();
        const auto refuse = [&](errc why, const char* words) { answer_later(std::move(answered), why, words); };
        if (!by || by->stopped()) {
            refuse(errc::stopped, "the service has been stopped");
        } else if (call_->ended()) {
            refuse(errc::cancelled, "the requesting job has already ended");
        } else if (const auto left = std::chrono::floor<std::chrono::milliseconds>(call_->due() - by->now());
                   left.count() <= 0) {
            refuse(errc::deadline, "the deadline of the requesting job has passed");
        } else {
            send(*by, command, options, std::move(answered), left);
        }
    }
    std::shared_ptr<job_feed_control> bind(job_feed_maker make, std::string_view noun,
                                           const bind_options& options) override {
        const auto by = std::static_pointer_cast<engine>(service_.lock());
        const bool ended = call_->ended();
        if (by && !by->stopped() && !ended) {
            take_on_stop();
        }
        return make({.service = by,
                     .ended = ended,
                     .executor = &executor_,
                     .job = weak_from_this(),
                     .noun = noun,
                     .options = &options,
                     .feeds = &feeds_});
    }
    void record_times(std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) override {
        call_->record_times(queued, ran);
    }
    void log(log_level level, std::string_view text) override {
        if (const auto by = service_.lock()) { // otherwise the log may be gone too
            call_->write_log(level, text);
        }
    }
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return executor_; }
    [[nodiscard]] const std::shared_ptr<core::call>& node_call() const noexcept override { return call_; }

  private:
    /// Its own requests that are in flight.
    struct asked {
        std::uint64_t last = 0;
        std::map<std::uint64_t, std::uint64_t> tickets; ///< for cancellation
        std::function<void()> then;                     ///< the handler's own stop callback
    };

    /// Passes the handler's answer to its callback. An exception from it fails the call, if there still is one.
    static void answer(const std::weak_ptr<service_call>& weak, const answer_callback& answered,
                       boost::system::error_code code, std::string_view json, std::string_view why) {
        try {
            answered(code, json, why);
        } catch (...) {
            if (const auto self = weak.lock()) {
                fail_with(*self, std::current_exception());
            }
        }
    }

    // Not from inside the requesting call: the caller may hold a lock, or may not have recorded its request yet.
    void answer_later(answer_callback answered, errc why, const char* words) {
        boost::asio::post(executor_, [weak = weak_from_this(), answered = std::move(answered), why, words] {
            answer(weak, answered, why, "{}", words);
        });
    }

    void send(core::local_node& by, std::string_view command, const call_options& options, answer_callback answered,
              std::chrono::milliseconds left) {
        take_on_stop();
        const auto key = ++asked_->last;
        asked_->tickets.emplace(key, 0);
        const auto why = std::make_shared<std::string>();
        auto completed = [weak = weak_from_this(), key, why,
                          answered = std::move(answered)](boost::system::error_code code, const json_text& reply) {
            const auto self = weak.lock(); // kept until the answer has been taken
            if (self) {
                self->asked_->tickets.erase(key);
            }
            answer(weak, answered, code, reply.text, code ? std::string_view{*why} : std::string_view{});
        };
        auto chosen = options;
        chosen.diagnostics(*why);
        if (const auto& trace = call_->wanted().trace; trace && chosen.trace_.empty()) {
            chosen.trace(protocol::traceparent_text(trace));
        }
        using operation = reply_operation<json_text, false, decltype(completed)>;
        const auto ticket = by.send_command(
            command, chosen, pending_ptr{make_operation<operation>(std::move(completed), executor_, why.get())}, left);
        if (const auto found = asked_->tickets.find(key); found != asked_->tickets.end()) {
            found->second = ticket;
        }
    }

    // A call has one stop callback: this object takes it, and then calls the handler's.
    void take_on_stop() {
        if (!asked_) {
            asked_ = std::make_unique<asked>();
            asked_->then = call_->forget_on_stop();
            call_->on_stop([this] { withdraw_asked(); });
        }
    }

    void close_feeds() {
        if (const auto feeds = std::exchange(feeds_, nullptr)) {
            feeds->close();
        }
    }

    /// Wraps the handler's callback so that it is called as user code. Posted: calls are stopped while the library
    /// iterates over what a lost link has left.
    [[nodiscard]] std::function<void()> put(std::function<void()> callback) const {
        return [host = call_->host(), callback = std::move(callback)]() mutable {
            host->completions.call(std::move(callback));
        };
    }

    void withdraw_asked() {
        const auto keep = weak_from_this().lock();
        const auto by = service_.lock();
        const auto then = std::exchange(asked_->then, nullptr);
        const auto tickets = std::exchange(asked_->tickets, {});
        const auto withdraw = [&] {
            for (const auto& [key, ticket] : tickets) {
                if (by) {
                    by->cancel(ticket);
                }
            }
            if (const auto feeds = std::exchange(feeds_, nullptr)) {
                feeds->close_soon(*call_);
            }
        };
        // First the job's own: it must know that it was stopped when its requests fail for that reason.
        try {
            if (then) {
                then();
            }
        } catch (...) {
            withdraw();
            throw;
        }
        withdraw();
    }

    std::shared_ptr<core::call> call_;
    boost::asio::any_io_executor executor_;
    std::weak_ptr<core::local_node> service_;
    std::unique_ptr<asked> asked_;         ///< from its first request or binding on
    std::shared_ptr<job_feed_list> feeds_; ///< from its first binding on
};

} // namespace

/// Updates from any thread on their way to the service's executor: what a `publisher` writes to. They wait in a list of
/// bounded length, whose oldest entries are dropped first.
class posted_updates final : public update_sink, public std::enable_shared_from_this<posted_updates> {
  public:
    posted_updates(boost::asio::any_io_executor executor, std::weak_ptr<core::local_node> service)
        : executor_(std::move(executor)), service_(std::move(service)) {}

    void publish(std::string_view noun, std::string_view json) override {
        const std::scoped_lock lock{mutex_};
        if (closed_) {
            return;
        }
        waiting_.push_back({std::string{noun}, std::string{json}});
        bytes_ += waiting_.back().size();
        while (waiting_.size() > max_waiting || (bytes_ > max_bytes && waiting_.size() > 1)) {
            bytes_ -= waiting_.front().size();
            waiting_.pop_front();
            ++dropped_;
        }
        if (!std::exchange(asked_, true)) {
            // Under the lock: once `close` returns, nothing is posted to an executor that may be gone.
            transport::post_call<&posted_updates::drain>(executor_, shared_from_this());
        }
    }
    /// Publishes what waits. Call it on the executor.
    void drain() {
        std::deque<entry> fetched;
        std::size_t lost = 0;
        {
            const std::scoped_lock lock{mutex_};
            asked_ = false;
            if (closed_) {
                return;
            }
            fetched.swap(waiting_);
            bytes_ = 0;
            lost = std::exchange(dropped_, 0);
        }
        if (lost != 0) {
            if (const auto by = service_.lock()) {
                by->write_log(log_level::warning,
                              std::to_string(lost) +
                                  " updates were dropped: they are published faster than they can be sent");
            }
        }
        for (const auto& update : fetched) {
            take(update);
        }
    }
    /// After this, nothing is posted. Call it on the executor.
    void close() {
        const std::scoped_lock lock{mutex_};
        closed_ = true;
        waiting_.clear();
    }

  private:
    static constexpr std::size_t max_waiting = 1024;
    static constexpr std::size_t max_bytes = 4U << 20U;

    struct entry {
        [[nodiscard]] std::size_t size() const noexcept { return noun.size() + json.size(); }

        std::string noun;
        std::string json;
    };

    void take(const entry& update) const {
        const auto by = service_.lock();
        if (!by) { // an earlier failure was logged, and the program then released the service
            return;
        }
        try {
            by->publish(update.noun, [&](json_writer& w) { write_text(w, update.json); });
        } catch (const error& e) {
            by->write_log(log_level::warning, "an update of '" + update.noun + "' was refused: " + e.message());
        }
    }

    boost::asio::any_io_executor executor_;
    std::weak_ptr<core::local_node> service_; // closes this when it stops
    std::mutex mutex_;                        // guards what follows
    std::deque<entry> waiting_;
    std::size_t bytes_ = 0;
    std::size_t dropped_ = 0;
    bool asked_ = false;
    bool closed_ = false;
};

engine::engine(const boost::asio::any_io_executor& executor, service_options options)
    : engine(std::make_shared<asio_port::asio_environment>(executor), std::move(options)) {}

engine::engine(std::shared_ptr<asio_port::asio_environment> by, service_options options)
    : local_node(by, options_of(std::move(options), *by)), asio_(*by) {}

void engine::add(registration offered) {
    core::handler entry{.info = std::move(offered.info)};
    if (offered.plain) {
        entry.plain = [this, handler = std::move(offered.plain)](const request& r, json_writer& w) {
            const auto during = flush_scheduler().serving();
            run_plain(handler, r, w);
        };
    }
    if (offered.async) {
        entry.start = [this, handler = std::move(offered.async),
                       self = weak_from_this()](const request& r, const std::shared_ptr<core::call>& call) {
            // Held here too, so that the reply is the handler's exception, and not that its responder was destroyed
            // without one.
            const auto control = std::make_shared<service_call>(call, executor(), self);
            const auto during = flush_scheduler().serving();
            try {
                handler(r, responder{control});
            } catch (...) {
                fail_with(*control, std::current_exception());
            }
        };
    }
    const bool is_announced = entry.info.must_be_signed && node().security && !node().tasks.is_signed(offered.task);
    node().tasks.add(offered.verb, offered.task, std::move(entry));
    if (is_announced) { // subscribers that do not know of it accept unsigned updates
        discovery().expedite_announcement();
    }
}

bool engine::remove(cles::verb verb, std::string_view offered) {
    std::shared_ptr<core::handler> removed = node().tasks.remove(verb, offered);
    if (!removed) {
        return false;
    }
    boost::asio::post(executor(),
                      [removed = std::move(removed)] {}); // destroyed later, because this may be called inside it
    discovery().expedite_announcement();
    return true;
}

std::shared_ptr<update_sink> engine::cross_thread_updates() {
    if (!posted_updates_) {
        posted_updates_ = std::make_shared<posted_updates>(executor(), weak_from_this());
        if (stopped()) {
            posted_updates_->close();
        }
    }
    return posted_updates_;
}

std::uint64_t engine::close(std::chrono::milliseconds limit, pending_ptr operation) {
    if (posted_updates_) {
        posted_updates_->drain();
    }
    return local_node::close(limit, std::move(operation));
}

void engine::stop() {
    if (belongs_to_parent()) {
        return;
    }
    if (posted_updates_) {
        posted_updates_->drain();
        posted_updates_->close();
    }
    local_node::stop();
}

void engine::keep(std::shared_ptr<const void> part) {
    static auto& kept = *new std::vector<std::shared_ptr<const void>>;
    static std::mutex mutex;
    const std::scoped_lock lock{mutex};
    kept.push_back(std::move(part));
}

} // namespace cles::detail
