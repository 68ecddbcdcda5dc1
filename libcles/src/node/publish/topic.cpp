// SPDX-License-Identifier: BSL-1.0
#include "node/publish/topic.hpp"

#include "protocol/datagram.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

namespace cles::core {

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
    begun_ = false;
    has_value_ = true;
    last_body_at_ = body_at;
    ++shared_.counts.updates_published;
    const auto newest = log_.last();
    log_.forget_before(bindings_.first_needed());
    // A large `keep` may exceed the limit on bytes.
    while (log_.first() < newest && log_.bytes(log_.first(), newest) > shared_.binding_bytes) {
        log_.forget_before(log_.first() + 1);
    }
    // If no subscriber takes every update, a large value keeps no spare memory; otherwise its buffer is reused.
    constexpr std::size_t roomy = 65536;
    if (!bindings_.is_unthinned() && log_.memory() > roomy &&
        log_.memory() / 4 * 3 > log_.bytes(log_.first(), newest)) {
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
    if (!has_value_ && !log_.empty() && !bindings_.is_behind()) {
        log_.clear();
        held_.resize(log_.memory());
    }
}

} // namespace cles::core
