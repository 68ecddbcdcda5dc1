// SPDX-License-Identifier: BSL-1.0
#include "shell/upstream_feed.hpp"

#include "protocol/reply_line.hpp"

#include <utility>

namespace cles::shell {
namespace {

// Updates that the publisher keeps for this node: it stands for many, and is to lose less than any of them.
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
    host_->settle();
}

void upstream_feed::wait() { static_cast<void>(machine_.mail().next(core::pending_event_ptr{this})); }

void upstream_feed::close() {
    if (std::exchange(to_, nullptr) == nullptr) {
        return;
    }
    machine_.close(errc::cancelled);
    host_->feeds().leave(machine_);
    // It may be closed from inside its own event: what is up the stack still needs it.
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

} // namespace cles::shell
