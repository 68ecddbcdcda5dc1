// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

#include "node/publish/sequence_tracker.hpp"

namespace cles::core {

bool subscription::take(const protocol::request_line& update, feed_mailbox::hand_over when) {
    auto& order = each_ ? each_->of(update.noun.target) : order_;
    const auto before = order;
    const auto arrived = order.accept(update, thinned_);
    if (arrived.gap) {
        on_event(*arrived.gap, when);
    }
    // After delivery, `order` may be gone: the handler may have closed the feed.
    if (arrived.is_new && !on_event(arrived.event, when)) {
        order = before;
        return false;
    }
    return arrived.is_new;
}

} // namespace cles::core
