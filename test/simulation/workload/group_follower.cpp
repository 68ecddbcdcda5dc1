// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/group_follower.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

group_follower::group_follower(node_run& at, std::uint32_t label, std::string target, std::string path,
                               std::chrono::milliseconds slow)
    : feed_reader(at, label, slow), feed_(at.bounds(), at.node()->completions, std::move(target), std::move(path)) {}

std::string group_follower::name() const {
    return at().name() + " group feed " + std::to_string(label()) + " of " + feed_.target() + ":" + feed_.path();
}

void group_follower::start() {
    local().group()->dispatcher().feeds().add(feed_, local().now());
    begin();
}

void group_follower::close() {
    leave();
    static_cast<void>(feed_.mail().close());
}

void group_follower::leave() {
    if (!std::exchange(left_, true)) {
        local().group()->dispatcher().feeds().remove(feed_);
    }
}

published_mark group_follower::last_of(std::string_view publisher) const {
    const auto found = sources_.find(publisher);
    return found == sources_.end() ? published_mark{} : found->second.last;
}

void group_follower::on_event(const detail::raw_event& event) {
    if (event.kind == feed_event::gap) {
        at().watcher().saw(name(), "missed", std::to_string(event.missed));
        if (at().fault() != planted::group_gap_hidden) {
            on_gap(event);
        }
    } else if (event.kind == feed_event::update) {
        on_update(event);
        if (at().fault() == planted::group_repeated && event.seq % 7 == 3) {
            on_update(event);
        }
    } else {
        complain(rule::update_order, "was told of more than updates and gaps");
    }
}

// What was shed before it was fetched is told for all publishers together.
void group_follower::on_gap(const detail::raw_event& event) {
    if (event.publisher.empty()) {
        shed_ += event.missed;
    } else {
        sources_[std::string{event.publisher}].missed += event.missed;
    }
}

void group_follower::on_update(const detail::raw_event& event) {
    at().watcher().saw(name(), "got", event.body);
    const auto mark = mark_of(event.body);
    const std::string who{event.publisher};
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
    if (before.run != mark.run) {
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
