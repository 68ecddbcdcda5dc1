// SPDX-License-Identifier: BSL-1.0
#include "core/group_feed.hpp"

#include "core/update_intake.hpp"

namespace cles::core {

bool group_feed::take(const protocol::request_line& update, feed_mailbox::hand_over when) {
    return take_in(publishers_.of(update.noun.target), update, false,
                   [this, when](const detail::raw_event& event) { return mail_.put(event, when); });
}

} // namespace cles::core
