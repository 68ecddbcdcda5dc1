// SPDX-License-Identifier: BSL-1.0
#include "node/publish/binding.hpp"

#include "node/publish/topic.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>

namespace cles::core {
namespace {

constexpr std::size_t piece = 65536; // bytes sent to a subscriber before it is asked for room again

} // namespace

void binding::drain(time_point now) {
    if (seen_ == source_.log_.last()) {
        return;
    }
    if (terms_.every.count() != 0) {
        drain_newest(now);
    } else {
        drain_all();
    }
}

void binding::drain_newest(time_point now) {
    if (now < next_due_) {
        if (!armed()) {
            source_.shared_.deadlines.arm(*this, next_due_);
        }
        return;
    }
    if (target_.takes_updates()) {
        const auto newest = source_.log_.last();
        target_.put_updates(source_.log_.lines(newest, newest));
        ++source_.shared_.counts.updates_delivered;
        seen_ = newest;
        next_due_ = saturating_add(now, terms_.every);
    }
}

void binding::drain_all() {
    const auto& log = source_.log_;
    const auto newest = log.last();
    auto from = std::max(seen_ + 1, log.first());
    if (newest - from >= terms_.keep) {
        from = newest - terms_.keep + 1;
    }
    while (from < newest && log.bytes(from, newest) > source_.shared_.binding_bytes) {
        ++from;
    }
    source_.shared_.counts.updates_shed += from - seen_ - 1;
    seen_ = from - 1;
    while (seen_ < newest && target_.takes_updates()) {
        auto to = newest;
        while (to > from && log.bytes(from, to) > piece) {
            to = from + (to - from) / 2;
        }
        target_.put_updates(log.lines(from, to));
        source_.shared_.counts.updates_delivered += to - seen_;
        seen_ = to;
        from = to + 1;
    }
}

bool binding::is_behind() const noexcept { return seen_ != source_.log_.last(); }

void binding::on_deadline(time_point now) { drain(now); }

binding& topic_bindings::bind(subscriber& target, binding::terms wanted) {
    auto* existing = find(target);
    if (existing == nullptr) {
        existing = bindings_.emplace_back(std::make_unique<binding>(of_, target, wanted)).get();
        existing->seen_ = of_.log_.last();
    } else if (existing->terms_ != wanted) { // else it is renewed, and nothing changes
        if (existing->terms_.every.count() != 0) {
            existing->seen_ = of_.log_.last(); // updates that `every` left out so far are not sent later
        }
        existing->set_terms(wanted);
        of_.shared_.deadlines.disarm(*existing);
        existing->next_due_ = {};
    }
    refresh();
    return *existing;
}

bool topic_bindings::unbind(subscriber& target) {
    const auto found =
        std::find_if(bindings_.begin(), bindings_.end(), [&](const auto& b) { return &b->target() == &target; });
    if (found == bindings_.end()) {
        return false;
    }
    bindings_.erase(found);
    refresh();
    return true;
}

binding* topic_bindings::find(const subscriber& target) noexcept {
    for (const auto& b : bindings_) {
        if (&b->target() == &target) {
            return b.get();
        }
    }
    return nullptr;
}

bool topic_bindings::is_behind() const noexcept {
    return std::any_of(bindings_.begin(), bindings_.end(), [](const auto& b) { return b->is_behind(); });
}

void topic_bindings::drain(time_point now) {
    for (const auto& b : bindings_) {
        b->drain(now);
    }
    refresh();
}

bool topic_bindings::has_room() const noexcept {
    if (!unthinned_) {
        return true;
    }
    const auto newest = of_.log_.last();
    const auto oldest_wanted = std::max(slowest_ + 1, of_.log_.first());
    return newest < room_until_ && of_.log_.bytes(oldest_wanted, newest) < of_.shared_.binding_bytes / 2;
}

std::uint64_t topic_bindings::first_needed() const noexcept {
    const auto newest = of_.log_.last();
    return unthinned_ ? std::max(slowest_ + 1, newest >= max_keep_ ? newest - max_keep_ + 1 : 1) : newest;
}

void topic_bindings::refresh() noexcept {
    unthinned_ = false;
    slowest_ = std::numeric_limits<std::uint64_t>::max();
    room_until_ = slowest_;
    max_keep_ = 0;
    for (const auto& b : bindings_) {
        if (b->terms_.every.count() == 0) {
            unthinned_ = true;
            slowest_ = std::min(slowest_, b->seen_);
            room_until_ = std::min(room_until_, b->seen_ + b->terms_.keep);
            max_keep_ = std::max(max_keep_, b->terms_.keep);
        }
    }
    of_.forget_retired();
}

} // namespace cles::core
