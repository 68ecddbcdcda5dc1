// SPDX-License-Identifier: BSL-1.0
#include "simulation/follower.hpp"

#include <charconv>
#include <utility>

namespace cles::simulation {
namespace {

std::uint64_t number_after(std::string_view json, std::string_view name) {
    const auto at = json.find(name);
    std::uint64_t value = 0;
    if (at != std::string_view::npos) {
        std::from_chars(json.data() + at + name.size(), json.data() + json.size(), value);
    }
    return value;
}

} // namespace

published_mark mark_of(std::string_view json) {
    return {.number = number_after(json, "{\"n\":"), .run = static_cast<unsigned>(number_after(json, "\"run\":"))};
}

/// The end of the first BIND. The follower's machine holds it, and so it does not hold the follower.
class follower::first_answer final : public detail::pending {
  public:
    explicit first_answer(std::weak_ptr<follower> owner) : owner_(std::move(owner)) {}
    verdict offer(std::string_view) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto owner = owner_.lock()) {
            owner->bound_ = true;
            owner->node_.later({}, [owner] { owner->fetch(); });
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view why) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto owner = owner_.lock()) {
            owner->node_.watcher().saw(owner->name(), "was refused", why);
        }
    }
    void discard() noexcept override { delete this; }

  private:
    std::weak_ptr<follower> owner_;
};

/// One wait for an event.
class follower::next_event final : public detail::pending_event {
  public:
    explicit next_event(std::weak_ptr<follower> owner) : owner_(std::move(owner)) {}
    bool deliver(const detail::raw_event& event) override {
        if (!event.has_json()) {
            return false;
        }
        const std::unique_ptr<next_event> self{this};
        if (const auto owner = owner_.lock()) {
            owner->on_event(event);
        }
        return true;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }

  private:
    std::weak_ptr<follower> owner_;
};

follower::follower(node_run& at, std::uint32_t label, feed_terms terms, std::string target, std::string path,
                   std::chrono::milliseconds slow)
    : node_(at), label_(label), terms_(std::move(terms)), slow_(slow),
      machine_(at.feeds(), at.node()->deadlines, at.bounds(), std::move(target), std::move(path), terms_.every_ms != 0,
               label * 7919U) {}

std::string follower::name() const { return node_.name() + " feed " + std::to_string(label_) + " of " + terms_.noun; }

void follower::start() {
    node_.feeds().enter(machine_, weak_from_this(), terms_);
    machine_.start(detail::pending_ptr{new first_answer{weak_from_this()}});
}

void follower::hold(std::chrono::milliseconds time) {
    held_ = true;
    node_.later(time, [weak = weak_from_this()] {
        if (const auto self = weak.lock()) {
            self->held_ = false;
            self->fetch();
        }
    });
}

void follower::close() {
    machine_.close(errc::cancelled);
    node_.feeds().leave(machine_);
}

void follower::fetch() {
    if (held_ || waits_ || !bound_ || machine_.closed()) {
        return;
    }
    waits_ = true;
    if (machine_.mail().next(core::feed_machine::event_ptr{new next_event{weak_from_this()}})) {
        node_.later({}, [self = shared_from_this()] { self->machine_.mail().pump(); });
    }
}

void follower::on_event(const detail::raw_event& event) {
    waits_ = false;
    if (!std::exchange(fetch_planned_, true)) {
        node_.later(slow_, [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->fetch_planned_ = false;
                self->fetch();
            }
        });
    }
    if (event.kind == feed_event::gap) {
        node_.watcher().saw(name(), "missed", std::to_string(event.missed));
        if (node_.fault() != planted::gap_hidden) {
            missed_ += event.missed;
        }
        if (is_thinned() && !event.publisher.empty()) {
            complain(rule::gaps_told, "is thinned, and was told of a gap");
        }
    } else if (event.kind == feed_event::update) {
        on_update(event);
        if (node_.fault() == planted::update_repeated && event.seq % 7 == 3) {
            on_update(event);
        }
    } else {
        node_.watcher().saw(name(),
                            event.kind == feed_event::current   ? "is bound at"
                            : event.kind == feed_event::rebound ? "is bound again"
                                                                : "is lost",
                            event.kind == feed_event::current ? event.body : event.text);
    }
}

void follower::on_update(const detail::raw_event& event) {
    node_.watcher().saw(name(), "got", event.body);
    ++seen_;
    const auto mark = mark_of(event.body);
    if (mark.number == 0) { // published on request: it does not say by which run
        return;
    }
    if (mark.number != event.seq) {
        complain(rule::update_order,
                 "got as " + std::to_string(event.seq) + " what was published as " + std::to_string(mark.number));
    }
    const auto before = std::exchange(last_, mark);
    const auto told = std::exchange(missed_, 0);
    if (before.run > mark.run || (before.run == mark.run && before.number >= mark.number)) {
        complain(rule::update_order, "got " + std::to_string(mark.number) + " of run " + std::to_string(mark.run) +
                                         " after " + std::to_string(before.number) + " of run " +
                                         std::to_string(before.run));
    } else if (before.run == mark.run && !is_thinned() && before.number + told + 1 != mark.number) {
        complain(rule::gaps_told, "got " + std::to_string(mark.number) + " after " + std::to_string(before.number) +
                                      " and was told of " + std::to_string(told) + " missed");
    }
}

} // namespace cles::simulation
