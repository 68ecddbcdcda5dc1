// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_peer.hpp"

#include <algorithm>

namespace cles::core {

// -- its description -----------------------------------------------------------------------------------------------

void link_peer::learn() {
    if (state_ == state::unasked) {
        state_ = state::asked;
        owner_.ask_peer();
    }
}

void link_peer::on_described(peer_description found) {
    state_ = state::described;
    description_ = std::move(found);
}

void link_peer::on_undescribed() noexcept {
    if (state_ != state::described) {
        state_ = state::unknown;
    }
}

void link_peer::forget() noexcept {
    state_ = state::unasked;
    description_ = {};
}

// -- its life ------------------------------------------------------------------------------------------------------

std::chrono::milliseconds link_peer::pause() const noexcept {
    return std::max(limit_ / 3, std::chrono::milliseconds{1});
}

void link_peer::begin(time_point now) {
    begun_ = now;
    open_.reset();
    deadlines_.arm(*this, now + pause());
}

// A long line that is still on its way is life too, in either direction: the peer answers the question after it. What
// the transport takes at once says nothing: the peer's host may keep it.
bool link_peer::has_moved_since(const link_traffic& then) const {
    const auto now = owner_.traffic();
    return now.received != then.received || (now.unsent != 0 && now.sent != then.sent);
}

void link_peer::on_deadline(time_point now) {
    if (!owner_.awaits_peer()) {
        open_.reset();
        return;
    }
    // After a suspension of this node, what has arrived meanwhile is not read yet.
    const bool is_late = now - due() > suspend_detector::punctual;
    if (is_late || !owner_.traffic().reads) {
        begin(now);
        return;
    }
    if (open_ && heard_ < open_->sent) {
        if (now < open_->lost) {
            deadlines_.arm(*this, std::min(open_->lost, now + pause()));
        } else if (has_moved_since(open_->traffic)) {
            begin(now);
        } else {
            open_.reset();
            owner_.on_hung();
        }
        return;
    }
    open_.reset();
    const auto silent_since = std::max(heard_, begun_);
    if (now - silent_since < pause()) {
        deadlines_.arm(*this, silent_since + pause());
    } else if (state_ != state::described && !owner_.is_node()) {
        deadlines_.arm(*this, now + pause()); // others may announce it later
    } else {
        // Who has become known as a node only now has as much time for the answer as others.
        open_ = question{now, std::max(silent_since + limit_, now + limit_ - pause()), owner_.traffic()};
        deadlines_.arm(*this, now + pause());
        owner_.ask_peer();
    }
}

} // namespace cles::core
