// SPDX-License-Identifier: BSL-1.0
#include "node/publish/binding.hpp"

#include "node/publish/topic.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::size_t piece = 65536; // bytes sent to a subscriber before its capacity is checked again

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

void binding::drain_last(time_point now) {
    next_due_ = {};
    drain(now);
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

void binding::set_terms(terms wanted) noexcept {
    if (terms_ == wanted) {
        return;
    }
    if (terms_.every.count() != 0) {
        seen_ = source_.log_.last(); // updates that `every` left out so far are not sent later
    }
    terms_ = wanted;
    source_.shared_.deadlines.disarm(*this);
    next_due_ = {};
}

// -- of one link -----------------------------------------------------------------------------------------------------

bool link_bindings::has(std::string_view path) noexcept {
    auto* t = source_.find(path);
    return t != nullptr && t->find(target_) != nullptr;
}

void link_bindings::bind(topic& t, binding::terms wanted) {
    if (t.find(target_) == nullptr) {
        topics_.push_back(&t);
    }
    t.bind(target_, wanted);
}

void link_bindings::release(topic& t) {
    t.unbind(target_);
    source_.release(t);
}

void link_bindings::unbind(std::string_view path) {
    auto* t = source_.find(path);
    if (t != nullptr && std::erase(topics_, t) != 0) {
        release(*t);
    }
}

void link_bindings::clear() {
    for (auto* t : std::exchange(topics_, {})) {
        release(*t);
    }
}

void link_bindings::drain_last(time_point now) {
    for (auto* t : topics_) {
        if (auto* b = t->find(target_)) {
            b->drain_last(now);
        }
    }
}

bool link_bindings::is_behind() const noexcept {
    return std::ranges::any_of(topics_, [this](topic* t) {
        const auto* const b = t->find(target_);
        return b != nullptr && b->is_behind();
    });
}

void link_bindings::drain(time_point now) {
    for (auto* t : topics_) {
        if (auto* b = t->find(target_)) {
            b->drain(now);
        }
    }
    const auto drained = topics_; // a publisher that continues may change the list
    for (auto* t : drained) {
        if (std::find(topics_.begin(), topics_.end(), t) != topics_.end()) {
            t->refresh();
            source_.admit(*t);
        }
    }
}

} // namespace cles::core
