// SPDX-License-Identifier: BSL-1.0
#include "core/topic.hpp"

#include "core/later.hpp"
#include "protocol/line.hpp"
#include "protocol/message.hpp"

#include <algorithm>
#include <limits>

namespace cles::core {
namespace {

constexpr std::size_t piece = 65536; // bytes put to a binder before it is asked again

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
        next_due_ = later(now, terms_.every);
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

std::string_view topic::last_body() const noexcept {
    if (!has_value_) {
        return {};
    }
    auto line = last_line();
    line.remove_suffix(1);
    return line.substr(last_body_at_);
}

// From its line, for what is passed on bears its publisher's.
std::optional<update_mark> topic::last_mark() const {
    protocol::request_line update;
    protocol::malformed_request ignored;
    if (!has_value_ || !protocol::parse_request(protocol::trim(last_line()), update, ignored) || !update.is_update()) {
        return std::nullopt;
    }
    return update_mark{.seq = *update.seq, .epoch = *update.epoch};
}

std::string_view topic::last_line() const noexcept {
    return has_value_ ? log_.lines(seq(), seq()) : std::string_view{};
}

void topic::commit(std::size_t body_at) {
    log_.commit();
    begun_ = false;
    has_value_ = true;
    last_body_at_ = body_at;
    ++shared_.counts.updates_published;
    const auto newest = log_.last();
    auto keep_from = newest;
    if (unthinned_) {
        keep_from = std::max(slowest_ + 1, newest >= longest_keep_ ? newest - longest_keep_ + 1 : 1);
    }
    log_.forget_before(keep_from);
    // A binder with a large `keep` may hold more lines than bytes.
    while (log_.first() < newest && log_.bytes(log_.first(), newest) > shared_.binding_bytes) {
        log_.forget_before(log_.first() + 1);
    }
    // What is large and stays for good takes no more than it is long; what is sent on in a row keeps its buffer.
    constexpr std::size_t roomy = 65536;
    if (!unthinned_ && log_.memory() > roomy && log_.memory() / 4 * 3 > log_.bytes(log_.first(), newest)) {
        log_.fit();
    }
    held_.resize(log_.memory());
}

void topic::roll_back() {
    log_.roll_back();
    begun_ = false;
    if (log_.memory() > held_.size()) {
        log_.fit();
        held_.resize(log_.memory());
    }
}

void topic::shed() {
    if (!log_.empty()) {
        log_.forget_before(log_.last());
    }
    log_.fit();
}

void topic::retire() {
    has_value_ = false;
    forget_retired();
}

void topic::forget_retired() noexcept {
    if (!has_value_ && !log_.empty() &&
        std::none_of(bindings_.begin(), bindings_.end(), [](const auto& b) { return b->is_behind(); })) {
        log_.clear();
        held_.resize(log_.memory());
    }
}

binding& topic::bind(binder& target, binding::terms wanted) {
    auto* existing = find(target);
    if (existing == nullptr) {
        existing = bindings_.emplace_back(std::make_unique<binding>(*this, target, wanted)).get();
        existing->seen_ = log_.last();
    } else if (existing->terms_ != wanted) { // else it is renewed, and goes on as it is
        if (existing->terms_.every.count() != 0) {
            existing->seen_ = log_.last(); // what was thinned out so far stays out
        }
        existing->set_terms(wanted);
        shared_.deadlines.disarm(*existing);
        existing->next_due_ = {};
    }
    refresh();
    return *existing;
}

bool topic::unbind(binder& target) {
    const auto found =
        std::find_if(bindings_.begin(), bindings_.end(), [&](const auto& b) { return &b->target() == &target; });
    if (found == bindings_.end()) {
        return false;
    }
    bindings_.erase(found);
    refresh();
    return true;
}

binding* topic::find(const binder& target) noexcept {
    for (const auto& b : bindings_) {
        if (&b->target() == &target) {
            return b.get();
        }
    }
    return nullptr;
}

void topic::drain(time_point now) {
    for (const auto& b : bindings_) {
        b->drain(now);
    }
    refresh();
}

bool topic::has_room() const noexcept {
    if (!unthinned_) {
        return true;
    }
    const auto newest = log_.last();
    const auto oldest_wanted = std::max(slowest_ + 1, log_.first());
    return newest < room_until_ && log_.bytes(oldest_wanted, newest) < shared_.binding_bytes / 2;
}

void topic::refresh() noexcept {
    unthinned_ = false;
    slowest_ = std::numeric_limits<std::uint64_t>::max();
    room_until_ = slowest_;
    longest_keep_ = 0;
    for (const auto& b : bindings_) {
        if (b->terms_.every.count() == 0) {
            unthinned_ = true;
            slowest_ = std::min(slowest_, b->seen_);
            room_until_ = std::min(room_until_, b->seen_ + b->terms_.keep);
            longest_keep_ = std::max(longest_keep_, b->terms_.keep);
        }
    }
    forget_retired();
}

} // namespace cles::core
