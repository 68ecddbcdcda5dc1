// SPDX-License-Identifier: BSL-1.0
#include "node/routing/next_hop.hpp"

#include <cles/feed_event.hpp>
#include <cles/pending.hpp>

#include "node/local_node.hpp"
#include "node/publish/feed_machine.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// A noun of another node, bound for this node's clients.
class upstream_feed final : private detail::pending_event, public std::enable_shared_from_this<upstream_feed> {
  public:
    /// `ended` is called if the noun cannot be bound, and releases this.
    upstream_feed(std::shared_ptr<local_node> host, std::string node, std::string path, core::feed_events& to,
                  std::function<void()> ended);
    ~upstream_feed();

    void begin(std::string_view adverbs);
    void close();

  private:
    class first_answer;

    // pending_event: this object always waits for the next event.
    bool deliver(const detail::raw_event& event) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void discard() noexcept override {}
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

    void wait();
    void on_refused(boost::system::error_code code, std::string_view message);

    std::shared_ptr<local_node> host_;
    core::feed_machine machine_;
    core::feed_events* to_; // null: closed
    std::function<void()> ended_;
};

namespace {

// A request has at most 16 adverbs, and this node writes up to six: id, deadline, progress, urgent, hops, via.
constexpr std::size_t max_foreign = protocol::max_adverbs - 6;

void append_foreign(std::string& out, const protocol::request_line& r) {
    protocol::part_reader parts{r.text};
    parts.next(); // verb
    parts.next(); // noun
    std::size_t count = 0;
    for (auto part = parts.next(); !part.empty() && count < max_foreign; part = parts.next()) {
        protocol::adverb a;
        if (protocol::split_adverb(part, a) && !protocol::is_known_adverb(a.key, r.verb)) {
            out.append(" ").append(part);
            ++count;
        }
    }
}

} // namespace

std::string forwarded_adverbs(const protocol::request_line& r, std::string_view own_name) {
    auto out = "hops=" + std::to_string(r.hops == 0 ? 0 : r.hops - 1) + " via=";
    if (!r.via.empty()) {
        out.append(r.via).push_back(',');
    }
    out.append(own_name);
    append_foreign(out, r);
    return out;
}

std::uint64_t peer_next_hop::send(const protocol::outgoing_request& r, time_point deadline, detail::pending_ptr reply,
                                  outbound::progress_function progress) {
    if (host_.stopped()) {
        host_.fail_later(std::move(reply), errc::stopped, {});
        return 0;
    }
    return host_.peer_channels().send(r.target(), {}, r, deadline, std::move(reply), std::move(progress));
}

peer_next_hop::~peer_next_hop() = default;

void peer_next_hop::stop() {
    for (const auto& [ticket, feed] : std::exchange(feeds_, {})) {
        feed->close();
    }
}

std::uint64_t peer_next_hop::bind(std::string_view node, std::string_view path, std::string_view adverbs,
                                  core::feed_events& to) {
    const auto ticket = host_.draw_id();
    const auto made = std::make_shared<upstream_feed>(host_.shared_from_this(), std::string{node}, std::string{path},
                                                      to, [this, ticket] { feeds_.erase(ticket); });
    feeds_.emplace(ticket, made);
    made->begin(adverbs);
    return ticket;
}

void peer_next_hop::unbind(std::uint64_t ticket) {
    if (const auto held = feeds_.extract(ticket); !held.empty()) {
        held.mapped()->close();
    }
}

void peer_next_hop::cancel(std::uint64_t ticket) { host_.cancel(ticket); }

namespace {

// Updates that the publisher keeps for this node, which stands for many clients and must lose less than any of them.
constexpr std::uint32_t upstream_keep = 1024;

protocol::failure failure_of(boost::system::error_code code, const std::string& node, std::string_view message) {
    const bool on_wire = code.category() == error_category() && wire_name(static_cast<errc>(code.value())) != "failed";
    protocol::failure why{.code = on_wire ? static_cast<errc>(code.value()) : errc::unavailable,
                          .message = std::string{message}};
    if (code == errc::failed) {
        why.code = errc::failed;
    }
    if (!why.message.starts_with(node)) {
        why.message.insert(0, node + ": ");
    }
    return why;
}

} // namespace

class upstream_feed::first_answer final : public detail::pending {
  public:
    explicit first_answer(std::weak_ptr<upstream_feed> to) : to_(std::move(to)) {}

    verdict offer(std::string_view json) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto alive = to_.lock(); alive && alive->to_ != nullptr) {
            alive->to_->on_bound(json);
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto alive = to_.lock()) {
            alive->on_refused(code, message);
        }
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    std::weak_ptr<upstream_feed> to_;
};

upstream_feed::upstream_feed(std::shared_ptr<local_node> host, std::string node, std::string path,
                             core::feed_events& to, std::function<void()> ended)
    : host_(std::move(host)), machine_(host_->feeds(), host_->deadlines(), host_->completions(), host_->bounds(),
                                       std::move(node), std::move(path), false, host_->environment().random()),
      to_(&to), ended_(std::move(ended)) {}

upstream_feed::~upstream_feed() { host_->feeds().leave(machine_); }

void upstream_feed::begin(std::string_view adverbs) {
    host_->feeds().enter(machine_, weak_from_this(),
                         {.noun = machine_.target() + ":" + machine_.path(),
                          .at = {},
                          .keep = upstream_keep,
                          .adverbs = std::string{adverbs},
                          .marked = true});
    wait();
    machine_.start(detail::pending_ptr{new first_answer(weak_from_this())});
}

void upstream_feed::wait() { static_cast<void>(machine_.mail().next(core::pending_event_ptr{this})); }

void upstream_feed::close() {
    if (std::exchange(to_, nullptr) == nullptr) {
        return;
    }
    machine_.close(errc::cancelled);
    host_->feeds().leave(machine_);
    // It may be closed from inside its own event: callers on the stack still need it.
    core::post(host_->environment(), [self = shared_from_this()] {});
}

void upstream_feed::on_refused(boost::system::error_code code, std::string_view message) {
    const auto self = shared_from_this();
    auto* to = std::exchange(to_, nullptr);
    if (to == nullptr) {
        return;
    }
    const auto why = failure_of(code, machine_.target(), message);
    host_->feeds().leave(machine_);
    core::post(host_->environment(), [self] {});
    ended_();
    to->on_refused(why);
}

bool upstream_feed::deliver(const detail::raw_event& event) {
    if (!event.has_json()) {
        return false;
    }
    wait();
    if (to_ != nullptr && event.kind == feed_event::update) {
        to_->on_update(event.line, event.body);
    } else if (to_ != nullptr && event.kind == feed_event::current) {
        const std::string last{event.body};
        to_->on_bound(last);
    }
    return true;
}

void upstream_feed::fail(boost::system::error_code, std::string_view) {}

} // namespace cles::core
