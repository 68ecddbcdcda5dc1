// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/follower.hpp"

#include "node/publish/feed_machine.hpp"
#include "node/publish/group_feeds.hpp"
#include "simulation/workload/body.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

class link_follower final : public follower, private core::feed_host {
  public:
    link_follower(node_run& node, manner what, core::feed_terms terms)
        : follower(node, std::move(what)), terms_(std::move(terms)),
          machine_(*this, node.node()->deadlines, node.node()->completions, node.bounds(), how().target, how().path,
                   how().thinned, how().label * 7919U) {}

    void start() override {
        local().feeds().enter(machine_, shared_from_this(), terms_);
        // The machine owns this object, so this does not own the follower.
        machine_.start(when_ended(if_alive(weak_self(), [](link_follower& self, std::string_view) { self.begin(); }),
                                  if_alive(weak_self(), [](link_follower& self, errc, std::string_view why) {
                                      self.at().watcher().saw(self.name(), "was refused", why);
                                  })));
        if (at().fault() == planted::rebind_hurried) {
            cap_pauses();
        }
    }
    void close() override { machine_.close(errc::cancelled); }

  private:
    [[nodiscard]] std::weak_ptr<link_follower> weak_self() {
        return std::static_pointer_cast<link_follower>(shared_from_this());
    }
    core::feed_mailbox& mail() override { return machine_.mail(); }
    // A planted fault: ends each pause after 20 ms at most.
    void cap_pauses() {
        at().later(milliseconds{20}, if_alive(weak_self(), [](link_follower& self) {
                       self.machine_.expedite(self.at().now());
                       self.cap_pauses();
                   }));
    }

    // Checks how the machine uses its host, and forwards all calls to the library's host.
    void bind(core::feed_machine& feed) override {
        constexpr milliseconds shortest_pause{75}; // the first one, a quarter shorter
        const auto now = at().now();
        // The group may have reported that the publisher is back.
        if (at().group() == nullptr && now < last_bind_ + shortest_pause) {
            complain(rule::backs_off, "binds again without a pause");
        }
        last_bind_ = now;
        local().feeds().bind(feed);
    }
    void unbind(core::feed_machine& feed) override { local().feeds().unbind(feed); }
    void detach(core::feed_machine& feed) override { local().feeds().detach(feed); }
    void renew(core::feed_machine& feed, time_point until) override { local().feeds().renew(feed, until); }

    core::feed_terms terms_;
    core::feed_machine machine_;
    time_point last_bind_{};
};

class group_follower final : public follower {
  public:
    group_follower(node_run& node, manner what)
        : follower(node, std::move(what)), feed_(node.bounds(), node.node()->completions, how().target, how().path) {}
    ~group_follower() override { leave(); }

    void start() override {
        local().group()->feeds().add(feed_, local().now());
        begin();
    }
    void close() override {
        leave();
        static_cast<void>(feed_.mail().close());
    }

  private:
    core::feed_mailbox& mail() override { return feed_.mail(); }
    void leave() {
        if (!std::exchange(left_, true)) {
            local().group()->feeds().remove(feed_);
        }
    }

    core::group_feed feed_;
    bool left_ = false;
};

} // namespace

std::shared_ptr<follower> follow_by_link(node_run& at, follower::manner how, core::feed_terms terms) {
    how.thinned = terms.every_ms != 0;
    return std::make_shared<link_follower>(at, std::move(how), std::move(terms));
}

std::shared_ptr<follower> follow_by_group(node_run& at, follower::manner how) {
    how.by_group = true;
    return std::make_shared<group_follower>(at, std::move(how));
}

std::string follower::name() const {
    return node_.name() + (how_.by_group ? " group feed " : " feed ") + std::to_string(how_.label) + " of " +
           how_.target + ":" + how_.path;
}

// -- fetching ------------------------------------------------------------------------------------------------------

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
            owner->take(event);
        }
        return true;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }

  private:
    std::weak_ptr<follower> owner_;
};

void follower::begin() {
    begun_ = true;
    node_.later({}, [self = shared_from_this()] { self->fetch(); });
}

void follower::hold(milliseconds time) {
    held_ = true;
    node_.later(time, if_alive(weak_from_this(), [](follower& self) {
                    self.held_ = false;
                    self.fetch();
                }));
}

void follower::fetch() {
    if (held_ || waits_ || !is_open()) {
        return;
    }
    waits_ = true;
    if (mail().next(core::feed_mailbox::event_ptr{new next_event{weak_from_this()}})) {
        node_.later({}, [self = shared_from_this()] { self->mail().pump(); });
    }
}

void follower::take(const detail::raw_event& event) {
    waits_ = false;
    if (!std::exchange(fetch_planned_, true)) {
        node_.later(how_.slow, if_alive(weak_from_this(), [](follower& self) {
                        self.fetch_planned_ = false;
                        self.fetch();
                    }));
    }
    if (event.kind == feed_event::gap) {
        on_gap(event);
    } else if (event.kind == feed_event::update) {
        on_update(event);
        if (node_.fault() == (how_.by_group ? planted::group_repeated : planted::update_repeated) &&
            event.seq % 7 == 3) {
            on_update(event);
        }
    } else if (how_.by_group) {
        complain(rule::update_order, "was told of more than updates and gaps");
    } else {
        node_.watcher().saw(name(),
                            event.kind == feed_event::current   ? "is bound at"
                            : event.kind == feed_event::rebound ? "is bound again"
                                                                : "is lost",
                            event.kind == feed_event::current ? event.body : event.text);
    }
}

// -- checks --------------------------------------------------------------------------------------------------------

// In the group, updates that were discarded before they were fetched are reported for all publishers together.
void follower::on_gap(const detail::raw_event& event) {
    node_.watcher().saw(name(), "missed", std::to_string(event.missed));
    if (node_.fault() != (how_.by_group ? planted::group_gap_hidden : planted::gap_hidden)) {
        const auto who = publisher_of(event);
        (who.empty() ? shed_ : sources_[who].missed) += event.missed;
    }
    if (how_.thinned && !event.publisher.empty()) {
        complain(rule::gaps_told, "is thinned, and was told of a gap");
    }
}

void follower::on_update(const detail::raw_event& event) {
    node_.watcher().saw(name(), "got", event.body);
    ++seen_;
    const published_mark mark{.number = number_after(event.body, "{\"n\":"),
                              .run = static_cast<unsigned>(number_after(event.body, "\"run\":"))};
    if (mark.number == 0 && !how_.by_group) { // published on request: does not contain the incarnation
        return;
    }
    const auto who = publisher_of(event);
    if (!wants(who)) {
        complain(rule::update_order, "got an update of " + who);
        return;
    }
    if (mark.number != event.seq) {
        complain(rule::update_order, "got as " + std::to_string(event.seq) + " of " + who + " what was published as " +
                                         std::to_string(mark.number));
    }
    auto& from = sources_[who];
    const auto before = std::exchange(from.last, mark);
    const auto told = std::exchange(from.missed, 0);
    const auto text = [&](const published_mark& m) {
        return std::to_string(m.number) + " of run " + std::to_string(m.run) + " of " + who;
    };
    if (before.run > mark.run || (before.run == mark.run && before.number >= mark.number)) {
        complain(rule::update_order, "got " + text(mark) + " after " + text(before));
        return;
    }
    if (before.run != mark.run || how_.thinned) {
        return;
    }
    const auto missed = mark.number - before.number - 1;
    const auto untold = missed - std::min(missed, told);
    if (told > missed || untold > shed_) {
        complain(rule::gaps_told, "got " + text(mark) + " after " + text(before) + " and was told of " +
                                      std::to_string(told) + " missed");
    }
    shed_ -= std::min(untold, shed_);
}

} // namespace cles::simulation
