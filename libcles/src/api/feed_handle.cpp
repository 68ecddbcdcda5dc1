// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/feed.hpp>

#include "api/engine.hpp"
#include "node/base/completion_queue.hpp"
#include "node/publish/feed_machine.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "node/publish/group_feeds.hpp"
#include "node/routing/peer_channels.hpp"
#include "protocol/grammar.hpp"
#include "protocol/request_line.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <random>
#include <string>
#include <utility>

namespace cles::detail {
namespace asio = boost::asio;

namespace {

std::uint32_t seed() {
    thread_local std::minstd_rand draw{std::random_device{}()};
    return static_cast<std::uint32_t>(draw());
}

void fail_next(const asio::any_io_executor& executor, event_ptr operation, boost::system::error_code code,
               std::string why) {
    asio::post(executor, [operation = std::move(operation), code, why = std::move(why)]() mutable {
        operation.release()->fail(code, why);
    });
}

/// A feed whose `start` fails with this reason.
class refused_feed final : public feed_control {
  public:
    refused_feed(std::shared_ptr<engine> host, boost::system::error_code code, std::string message)
        : host_(std::move(host)), code_(code), message_(std::move(message)) {}

    void start(pending_ptr bound) override { host_->fail_later(std::move(bound), code_, message_); }
    void next(event_ptr operation) override { fail_next(host_->executor(), std::move(operation), code_, message_); }
    void cancel_start() override {}
    void cancel(const pending_event*) override {}
    void close() override {}
    [[nodiscard]] const asio::any_io_executor& executor() const override { return host_->executor(); }

  private:
    std::shared_ptr<engine> host_;
    boost::system::error_code code_;
    std::string message_;
};

/// A feed as its user holds it: what does not depend on how it is bound.
class feed_handle : public feed_control, public std::enable_shared_from_this<feed_handle> {
  public:
    explicit feed_handle(std::shared_ptr<engine> host) : host_(std::move(host)) {}

    void cancel_start() final {
        if (is_starting()) {
            close();
        }
    }
    void close() final {
        if (host_->belongs_to_parent()) {
            engine::keep(shared_from_this());
            return;
        }
        unbind();
        // It may be closed from inside its own event: functions up the stack still need it.
        asio::post(executor(), [self = shared_from_this()] {});
    }
    [[nodiscard]] const asio::any_io_executor& executor() const final { return host_->executor(); }

  protected:
    [[nodiscard]] engine& host() const noexcept { return *host_; }
    virtual void unbind() = 0;
    [[nodiscard]] virtual bool is_starting() const = 0;
    /// \param mail of the derived class
    void attach(core::feed_mailbox& mail) {
        mail.set_pump([this, &mail] { pump_soon(mail); });
    }
    /// One call of `async_next`: completes with the next event or an error, never inside this call.
    void fetch(core::feed_mailbox& from, event_ptr operation) {
        if (from.closed()) {
            fail_next(executor(), std::move(operation), errc::stopped, "the feed is closed");
        } else if (from.has_waiter()) {
            fail_next(executor(), std::move(operation), errc::busy, "another async_next of this feed is pending");
        } else if (from.next(std::move(operation))) {
            pump_soon(from);
        }
    }

  private:
    // A handler that waits again gets the next event in the same function, until it has all that waited when this
    // began: otherwise what one read brings could outpace it. When it waits, `fetch` posts the function for what
    // remains: it may throw then, or run the executor until the next event comes.
    void pump(core::feed_mailbox& mail) {
        is_pump_posted_ = false;
        for (auto left = mail.unfetched() + 1; left != 0 && mail.pump(); --left) {
        }
    }
    void pump_soon(core::feed_mailbox& mail) {
        if (!std::exchange(is_pump_posted_, true)) {
            asio::post(executor(), [&mail, self = shared_from_this()] { self->pump(mail); });
        }
    }

    std::shared_ptr<engine> host_;
    bool is_pump_posted_ = false;
};

/// A feed that is bound by a link.
class link_feed final : public feed_handle {
  public:
    link_feed(const std::shared_ptr<engine>& by, const limits& bounds, std::string target, std::string path,
              bool thinned)
        : feed_handle(by), machine_(by->feeds(), by->deadlines(), by->completions(), bounds, std::move(target),
                                    std::move(path), thinned, seed()) {
        attach(machine_.mail());
    }

    [[nodiscard]] core::feed_machine& machine() noexcept { return machine_; }
    void start(pending_ptr bound) override {
        const auto limit = core::time_limit(machine_.entry().terms.deadline, verb::bind);
        machine_.start(std::move(bound), core::saturating_add(host().now(), limit));
    }
    void next(event_ptr operation) override { fetch(machine_.mail(), std::move(operation)); }
    void cancel(const pending_event* operation) override { machine_.mail().cancel(operation); }

  private:
    void unbind() override { machine_.close(errc::cancelled); }
    [[nodiscard]] bool is_starting() const override { return machine_.is_starting(); }

    core::feed_machine machine_;
};

/// A feed that is bound through the multicast group, in which the service takes part.
class group_feed_handle final : public feed_handle {
  public:
    group_feed_handle(const std::shared_ptr<engine>& by, const limits& bounds, std::string target, std::string path)
        : feed_handle(by), feed_(bounds, by->completions(), std::move(target), std::move(path)) {
        attach(feed_.mail());
    }
    ~group_feed_handle() override { leave(); }

    /// Completes as soon as the BIND has been sent: it is not answered.
    void start(pending_ptr bound) override {
        if (host().stopped()) {
            static_cast<void>(feed_.mail().close());
            host().fail_later(std::move(bound), errc::stopped, "the service has been stopped");
            return;
        }
        host().group()->feeds().add(feed_, host().now());
        starting_ = true;
        asio::post(executor(), [bound = std::move(bound), keep = shared_from_this(), this]() mutable {
            starting_ = false;
            if (feed_.mail().closed()) {
                const bool stopped = host().stopped();
                bound.release()->fail(stopped ? errc::stopped : errc::cancelled, "the feed was closed");
            } else {
                core::end_with(std::move(bound), "{}");
            }
        });
    }
    void next(event_ptr operation) override { fetch(feed_.mail(), std::move(operation)); }
    void cancel(const pending_event* operation) override { feed_.mail().cancel(operation); }

  private:
    void unbind() override {
        leave();
        if (auto waiting = feed_.mail().close()) {
            host().completions().put(core::completion{
                core::completion::event_failure{std::move(waiting), errc::cancelled, "the feed was closed"}});
        }
    }
    [[nodiscard]] bool is_starting() const override { return starting_; }
    void leave() {
        if (auto* group = std::exchange(left_, true) ? nullptr : host().group()) {
            group->feeds().remove(feed_);
        }
    }

    core::group_feed feed_;
    bool starting_ = false;
    bool left_ = false; // and may be destroyed on any thread
};

/// Why a noun cannot be bound through the group; `message` is empty if it can.
struct refusal {
    errc code = errc::no_target;
    std::string message;
};

refusal objection_to(engine& host, const protocol::noun_view& noun, const bind_options& options) {
    const std::string target{noun.target};
    if (!options.at_.empty()) {
        return {errc::bad_request, "a binding by multicast must not have an address: '" + options.at_ + "'"};
    }
    if (noun.task == "cles") {
        return {errc::bad_request, "the task 'cles' cannot be bound by multicast"};
    }
    if (target == "self" || target == "any") {
        return {errc::no_target, "a binding by multicast needs a node's name or 'all', not '" + target + "'"};
    }
    if (target == host.node().name) {
        return {errc::no_target, "a node cannot bind its own tasks by multicast"};
    }
    if (host.group() == nullptr) {
        return {errc::no_target, "'" + target + ":" + std::string{noun.path} +
                                     "' needs multicast, which is off: set an interface in service_options::multicast"};
    }
    return {};
}

} // namespace

std::shared_ptr<feed_control> make_feed(const std::shared_ptr<engine>& host, std::string_view noun,
                                        const bind_options& options, std::size_t most) {
    const auto refused = [&](errc code, std::string why) {
        return std::make_shared<refused_feed>(host, code, std::move(why));
    };
    protocol::noun_view parts;
    std::string why;
    if (!protocol::parse_noun(noun, parts, why)) {
        return refused(errc::bad_request, std::move(why));
    }
    if (auto wrong = core::invalid_option_reason(options); !wrong.empty()) {
        return refused(errc::invalid_option, std::move(wrong));
    }
    if (host->stopped()) {
        return refused(errc::stopped, "the service has been stopped");
    }
    const bool is_own = !options.is_on_behalf_;
    if (!is_own) {
        if (auto objection = core::objection_to_member(host->node(), options, verb::bind, parts)) {
            return refused(objection->code, std::move(objection->message));
        }
        if (options.multicast_) {
            return refused(errc::invalid_option, "bind_options::on_behalf_of does not go together with multicast");
        }
    }
    std::string scratch;
    const std::string path{protocol::canonical_path(parts, scratch)};
    const std::string target{parts.target};
    auto bounds = host->bounds();
    bounds.feed = most != 0 ? most : bounds.feed;
    const bool routes = host->node().active_router != nullptr; // then links bind `all`, through this service itself
    if (options.multicast_ || (target == "all" && options.at_.empty() && is_own && !routes)) {
        if (auto objection = objection_to(*host, parts, options); !objection.message.empty()) {
            return refused(objection.code, std::move(objection.message));
        }
        return std::make_shared<group_feed_handle>(host, bounds, target, path);
    }
    if (options.at_.empty()) {
        host->peer_channels().tell_of_second(target, options.diagnostics_);
    }
    auto made = std::make_shared<link_feed>(host, bounds, target, path, options.every_.count() > 0);
    host->feeds().enter(made->machine(), made,
                        {.noun = std::string{noun},
                         .at = is_own ? options.at_ : host->own_url(),
                         .at_node = options.at_node_,
                         .deadline = options.deadline_,
                         .every_ms = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
                             options.every_.count(), 0, static_cast<std::int64_t>(protocol::max_deadline_ms))),
                         .keep = options.keep_,
                         .hops = options.hops_,
                         .adverbs = is_own ? std::string{} : protocol::adverb_from(options.on_behalf_of_),
                         .shows_mark = options.mark_,
                         .requester = options.on_behalf_of_});
    return made;
}

} // namespace cles::detail
