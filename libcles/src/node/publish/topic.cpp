// SPDX-License-Identifier: BSL-1.0
#include "node/publish/topic.hpp"

#include "protocol/line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <limits>

namespace cles::core {

void update_log::commit() {
    text_.push_back('\n');
    ends_.push_back(text_.size());
}

void update_log::roll_back() { text_.resize(start_of(last() + 1)); }

std::string_view update_log::pending() const noexcept { return std::string_view{text_}.substr(start_of(last() + 1)); }

std::size_t update_log::start_of(std::uint64_t number) const noexcept {
    const auto index = head_ + static_cast<std::size_t>(number - first_);
    return index == 0 ? 0 : ends_[index - 1];
}

std::string_view update_log::lines(std::uint64_t from, std::uint64_t to) const noexcept {
    if (from > to) {
        return {};
    }
    const auto start = start_of(from);
    return std::string_view{text_}.substr(start, start_of(to + 1) - start);
}

void update_log::forget_before(std::uint64_t from) {
    if (empty()) {
        return;
    }
    from = std::min(from, last());
    if (from <= first_) {
        return;
    }
    head_ += static_cast<std::size_t>(from - first_);
    first_ = from;
    // Forgotten text is removed once it is no shorter than the rest, which keeps the cost per line constant.
    const auto forgotten = start_of(first_);
    if (forgotten > 4096 && forgotten >= text_.size() - forgotten) {
        compact();
        constexpr std::size_t roomy = 65536;
        if (text_.capacity() > roomy && text_.size() < text_.capacity() / 8) {
            text_.shrink_to_fit();
        }
    }
}

void update_log::compact() {
    const auto forgotten = start_of(first_);
    text_.erase(0, forgotten);
    ends_.erase(ends_.begin(), ends_.begin() + static_cast<std::ptrdiff_t>(head_));
    for (auto& end : ends_) {
        end -= forgotten;
    }
    head_ = 0;
}

void update_log::clear() noexcept {
    first_ = last() + 1;
    std::string{}.swap(text_); // assigning {} would keep their memory
    std::vector<std::size_t>{}.swap(ends_);
    head_ = 0;
}

void update_log::fit() {
    compact();
    text_.shrink_to_fit();
    ends_.shrink_to_fit();
}

// -- the last updates ------------------------------------------------------------------------------------------------

std::string_view topic::last_body() const noexcept {
    if (!has_value_) {
        return {};
    }
    auto line = last_line();
    line.remove_suffix(1);
    return line.substr(last_body_at_);
}

// From the line, since a relayed update has its publisher's mark.
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
    has_value_ = true;
    last_body_at_ = body_at;
    ++shared_.counts.updates_published;
    const auto newest = log_.last();
    log_.forget_before(first_needed());
    // A large `keep` may exceed the limit on bytes.
    while (log_.first() < newest && log_.bytes(log_.first(), newest) > shared_.binding_bytes) {
        log_.forget_before(log_.first() + 1);
    }
    // If no subscriber takes every update, a large value keeps no spare memory; otherwise its buffer is reused.
    constexpr std::size_t roomy = 65536;
    if (!unthinned_ && log_.memory() > roomy && log_.memory() / 4 * 3 > log_.bytes(log_.first(), newest)) {
        log_.fit();
    }
    held_.resize(log_.memory());
}

void topic::roll_back() {
    log_.roll_back();
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
    if (!has_value_ && !log_.empty() && std::ranges::none_of(bindings_, [](const auto& b) { return b->is_behind(); })) {
        log_.clear();
        held_.resize(log_.memory());
    }
}

// -- the subscribers -------------------------------------------------------------------------------------------------

void topic::bind(subscriber& target, binding::terms wanted) {
    auto* existing = find(target);
    if (existing == nullptr) {
        bindings_.push_back(std::make_unique<binding>(*this, target, wanted, log_.last()));
    } else {
        existing->set_terms(wanted);
    }
    refresh();
}

bool topic::unbind(subscriber& target) {
    const bool was_bound = std::erase_if(bindings_, [&](const auto& b) { return &b->target() == &target; }) != 0;
    if (was_bound) {
        refresh();
    }
    return was_bound;
}

binding* topic::find(const subscriber& target) noexcept {
    const auto found = std::ranges::find_if(bindings_, [&](const auto& b) { return &b->target() == &target; });
    return found == bindings_.end() ? nullptr : found->get();
}

void topic::drain(time_point now) {
    for (const auto& b : bindings_) {
        b->drain(now);
    }
    refresh();
}

void topic::tell_denied() const {
    for (const auto& b : bindings_) {
        b->target().on_denied();
    }
}

bool topic::has_capacity() const noexcept {
    if (!unthinned_) {
        return true;
    }
    const auto newest = log_.last();
    const auto oldest_wanted = std::max(slowest_ + 1, log_.first());
    return newest < fits_until_ && log_.bytes(oldest_wanted, newest) < shared_.binding_bytes / 2;
}

// The first update that a subscriber still needs.
std::uint64_t topic::first_needed() const noexcept {
    const auto newest = log_.last();
    return unthinned_ ? std::max(slowest_ + 1, newest >= max_keep_ ? newest - max_keep_ + 1 : 1) : newest;
}

void topic::refresh() noexcept {
    unthinned_ = false;
    slowest_ = std::numeric_limits<std::uint64_t>::max();
    fits_until_ = slowest_;
    max_keep_ = 0;
    for (const auto& b : bindings_) {
        if (b->terms_.every.count() == 0) {
            unthinned_ = true;
            slowest_ = std::min(slowest_, b->seen_);
            fits_until_ = std::min(fits_until_, b->seen_ + b->terms_.keep);
            max_keep_ = std::max(max_keep_, b->terms_.keep);
        }
    }
    forget_retired();
}

} // namespace cles::core
