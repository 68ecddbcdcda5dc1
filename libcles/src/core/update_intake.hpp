// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "core/update_order.hpp"
#include "protocol/request_line.hpp"

#include <string_view>

namespace cles::core {

/// Takes an update in: tells `on_event` of a gap that it shows, then of itself. False where it is old or repeated, or
/// `on_event` says that its body is not JSON; then nothing is remembered of it.
template <class Sink>
bool take_in(update_order& order, const protocol::request_line& update, bool thinned, Sink&& on_event) {
    const auto before = order;
    const auto verdict = order.take(*update.epoch, *update.seq);
    if (!verdict.news) {
        return false;
    }
    detail::raw_event event{.body = update.body.empty() ? std::string_view{"{}"} : update.body,
                            .publisher = update.noun.target,
                            .seq = *update.seq,
                            .line = update.text,
                            .reading = update.reading};
    if (verdict.missed != 0 && !thinned) {
        event.checked = event.has_json();
        if (!event.checked) {
            order = before;
            return false;
        }
        on_event(detail::raw_event{
            .kind = feed_event::gap, .publisher = event.publisher, .seq = event.seq, .missed = verdict.missed});
    }
    // Once it has been handed on, whose order it is may be gone: its handler may have closed the feed.
    if (on_event(event)) {
        return true;
    }
    order = before; // a later update shows that this one is missing
    return false;
}

} // namespace cles::core
