// SPDX-License-Identifier: BSL-1.0
#include "core/call.hpp"

#include "core/node.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

call::call(std::shared_ptr<node> host, call_owner& owner, terms wanted, time_point started)
    : node_(std::move(host)), owner_(&owner), terms_(std::move(wanted)), started_(started) {
    ++node_->counts.handlers_running;
    node_->counts.routed += terms_.routed ? 1 : 0;
}

call::~call() {
    --node_->counts.handlers_running;
    node_->counts.routed -= terms_.routed ? 1 : 0;
}

call::terms call::terms_of(const protocol::request_line& r) {
    return {.verb = r.verb,
            .id = r.id,
            .wants_reply = r.wants_reply,
            .wants_progress = r.wants_progress,
            .urgent = r.urgent};
}

bool call::hold(const std::shared_ptr<memory_account>& memory, std::size_t text) {
    constexpr std::size_t around = 512; // itself and its handler's part, about
    held_ = memory_reservation{memory};
    return held_.try_resize(text + terms_.publish_body.size() + around);
}

void call::done(std::string_view json) {
    if (owner_ != nullptr) {
        owner_->answer(*this, json);
    }
}

void call::fail(protocol::failure why) {
    if (owner_ != nullptr) {
        owner_->refuse(*this, why);
    }
}

bool call::progress(double fraction, std::string_view json) {
    if (owner_ == nullptr || !terms_.wants_progress || terms_.id == 0) {
        return false;
    }
    reported_ = std::max(reported_, std::clamp(fraction, 0.0, 1.0));
    owner_->report(*this, reported_, json);
    return true;
}

void call::say(log_level level, std::string_view text) const {
    node_->say(level, {text, owner_ != nullptr ? owner_->peer_address() : std::string_view{}, terms_.id});
}

void call::on_stop(std::function<void()> callback) {
    if (stopped_) {
        callback();
    } else if (owner_ != nullptr) {
        on_stop_ = std::move(callback);
    }
}

void call::detach() noexcept {
    owner_ = nullptr;
    node_->deadlines.disarm(*this);
}

void call::stop() {
    stopped_ = true;
    if (const auto callback = std::exchange(on_stop_, nullptr)) {
        callback();
    }
}

void call::on_deadline(time_point) {
    const auto keep = shared_from_this();
    fail({.code = errc::deadline, .message = node_->name + " did not finish in time"});
    stop();
}

} // namespace cles::core
