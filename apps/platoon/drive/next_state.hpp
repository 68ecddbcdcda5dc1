// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/feed.hpp>

#include "platoon/driver/localization.hpp"

#include <boost/asio/awaitable.hpp>

namespace platoon {

/// The next event of a feed of states. Anybody may publish in the group: an update that is no state counts as one that
/// is missing, with the reason in `text`.
inline boost::asio::awaitable<cles::feed_item<state_message>> next_state(cles::feed<state_message>& feed) {
    cles::feed_item<state_message> unreadable;
    try {
        co_return co_await feed.async_next();
    } catch (const cles::error& e) {
        if (e.code() != cles::errc::conversion) {
            throw;
        }
        unreadable.kind = cles::feed_event::gap;
        unreadable.missed = 1;
        unreadable.text = e.message();
    }
    co_return unreadable;
}

} // namespace platoon
