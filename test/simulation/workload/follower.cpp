// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/follower.hpp"

#include <utility>

namespace cles::simulation {

/// The end of the first BIND. The follower's machine holds it, and so it does not hold the follower.
class follower::first_answer final : public detail::pending {
  public:
    explicit first_answer(std::weak_ptr<follower> owner) : owner_(std::move(owner)) {}
    verdict offer(std::string_view) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto owner = owner_.lock()) {
            owner->begin();
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view why) override {
        const std::unique_ptr<first_answer> self{this};
        if (const auto owner = owner_.lock()) {
            owner->at().watcher().saw(owner->name(), "was refused", why);
        }
    }
    void discard() noexcept override { delete this; }

  private:
    std::weak_ptr<follower> owner_;
};

follower::follower(node_run& at, std::uint32_t label, unsigned to, core::feed_terms terms, std::string target,
                   std::string path, std::chrono::milliseconds slow)
    : feed_reader(at, label, slow), to_(to), terms_(std::move(terms)),
      machine_(at.local().feeds(), at.node()->deadlines, at.node()->completions, at.bounds(), std::move(target),
               std::move(path), terms_.every_ms != 0, label * 7919U) {}

std::string follower::name() const { return at().name() + " feed " + std::to_string(label()) + " of " + terms_.noun; }

void follower::start() {
    const auto self = std::static_pointer_cast<follower>(shared_from_this());
    local().feeds().enter(machine_, self, terms_);
    machine_.start(detail::pending_ptr{new first_answer{self}});
}

void follower::close() {
    machine_.close(errc::cancelled);
    leave();
}

void follower::leave() {
    if (!std::exchange(left_, true)) {
        local().feeds().leave(machine_);
    }
}

void follower::on_event(const detail::raw_event& event) {
    if (event.kind == feed_event::gap) {
        at().watcher().saw(name(), "missed", std::to_string(event.missed));
        if (at().fault() != planted::gap_hidden) {
            missed_ += event.missed;
        }
        if (is_thinned() && !event.publisher.empty()) {
            complain(rule::gaps_told, "is thinned, and was told of a gap");
        }
    } else if (event.kind == feed_event::update) {
        on_update(event);
        if (at().fault() == planted::update_repeated && event.seq % 7 == 3) {
            on_update(event);
        }
    } else {
        at().watcher().saw(name(),
                           event.kind == feed_event::current   ? "is bound at"
                           : event.kind == feed_event::rebound ? "is bound again"
                                                               : "is lost",
                           event.kind == feed_event::current ? event.body : event.text);
    }
}

void follower::on_update(const detail::raw_event& event) {
    at().watcher().saw(name(), "got", event.body);
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
