// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_machine.hpp"

#include "protocol/reply_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

feed_machine::feed_machine(feed_host& host, deadline_queue& deadlines, completion_queue& completions,
                           const limits& bounds, std::string target, std::string path, bool thinned, std::uint32_t seed)
    : subscription(std::move(target), std::move(path), thinned, bounds.publishers), host_(host), deadlines_(deadlines),
      max_line_(bounds.line), completions_(completions), mail_(bounds, completions), backoff_(seed), jitter_(~seed),
      lease_(bounds.lease) {}

void feed_machine::start(detail::pending_ptr bound, time_point due) {
    first_ = std::move(bound);
    state_ = state::binding;
    if (due != time_point::max()) {
        deadlines_.arm(*this, due);
    }
    host_.bind(*this);
}

void feed_machine::on_bound(std::string_view last, const std::optional<update_mark>& as_update,
                            const update_mark& mark) {
    if (state_ != state::binding) {
        return;
    }
    state_ = state::bound;
    deadlines_.disarm(*this);
    // The events are queued before the caller's operation completes, so that it finds them in order.
    const std::string body{last};
    if (was_bound_) {
        mail_.put({.kind = feed_event::rebound});
    }
    was_bound_ = true;
    if (as_update) {
        take_marked(body, *as_update);
        if (state_ != state::bound) { // its handler has closed the feed
            return;
        }
    }
    if (body != "{}") {
        mail_.put({.kind = feed_event::current, .body = body, .checked = true, .seq = mark.seq, .epoch = mark.epoch});
    }
    if (first_) {
        completions_.succeed(std::move(first_), body);
    }
}

// As if the publisher had sent it again: a repeat is dropped, a gap or a restart is reported.
void feed_machine::take_marked(const std::string& body, const update_mark& mark) {
    std::string line;
    protocol::append_update_head(line, target(), path(), mark.seq, protocol::epoch_text(mark.epoch));
    line.append(body);
    protocol::request_line update;
    protocol::malformed_request ignored;
    if (line.size() <= max_line_ && protocol::parse_request(line, update, ignored)) {
        take(update);
    }
}

void feed_machine::on_leased(time_point sent_at) {
    if (state_ == state::bound) {
        bound_at_ = sent_at;
        begin_lease(sent_at);
    }
}

void feed_machine::begin_lease(time_point sent_at) {
    lease_end_ = saturating_add(sent_at, lease_);
    // At least 1 ms: otherwise a tiny lease would be renewed all the time. It expires in between instead.
    const auto third = std::max(lease_ / 3, std::chrono::milliseconds{1});
    deadlines_.arm(*this, saturating_add(sent_at, third - jitter_.quarter_of(third)));
}

// The publisher was busy: tries again in the remaining time. False if none is left.
bool feed_machine::renew_later(time_point now) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(lease_end_ - now);
    constexpr std::chrono::milliseconds shortest{20};
    if (left < shortest) {
        return false;
    }
    const auto third = std::max(left / 3, shortest);
    deadlines_.arm(*this, saturating_add(now, third - jitter_.quarter_of(third)));
    return true;
}

void feed_machine::on_renewed(time_point sent_at) {
    if (state_ == state::bound && sent_at >= bound_at_) {
        begin_lease(sent_at);
    }
}

void feed_machine::on_renewal_refused(time_point sent_at, boost::system::error_code why, std::string_view message,
                                      time_point now) {
    if (state_ != state::bound || sent_at < bound_at_) { // of an earlier binding
        return;
    }
    if (why == errc::too_large) { // it is renewed: only the last value did not fit into the reply
        on_renewed(sent_at);
    } else if (why != errc::busy || !renew_later(now)) {
        const std::string text{why == errc::deadline ? "the publisher did not renew the lease in time" : message};
        host_.detach(*this);
        on_lost(text, now);
    }
}

void feed_machine::on_refused(boost::system::error_code why, std::string_view message, time_point now,
                              std::string_view answer) {
    if (state_ != state::binding) {
        return;
    }
    if (first_) {
        auto operation = std::move(first_);
        const std::string text{message};
        const std::string whole{answer};
        close(errc::cancelled);
        if (protocol::failure reported; !whole.empty() && protocol::parse_failure(whole, reported)) {
            completions_.refuse(std::move(operation), reported, whole);
        } else {
            completions_.fail(std::move(operation), why, text);
        }
        return;
    }
    const std::string text{message};
    pause(now);
    if (why == errc::denied && entry_.on_denied) {
        entry_.on_denied(text);
    }
}

void feed_machine::on_lost(std::string_view why, time_point now) {
    if (state_ != state::bound) {
        return;
    }
    if (now - bind_sent_at_ >= proven) {
        backoff_.reset();
    }
    pause(now);
    mail_.put({.kind = feed_event::lost, .text = why});
}

void feed_machine::pause(time_point now) {
    state_ = state::pausing;
    deadlines_.arm(*this, saturating_add(now, backoff_.next()));
}

void feed_machine::expedite(time_point now) {
    if (state_ == state::pausing) {
        backoff_.reset();
        deadlines_.arm(*this, now);
    }
}

void feed_machine::on_deadline(time_point now) {
    if (first_) {
        on_refused(errc::deadline, "no answer was received in time", now);
    } else if (state_ == state::pausing) {
        state_ = state::binding;
        bind_sent_at_ = now;
        host_.bind(*this);
    } else if (state_ == state::bound) {
        host_.renew(*this, lease_end_);
    }
}

// The operations are taken out of the feed, which they may own: otherwise neither would be destroyed if the context
// never runs again.
void feed_machine::close(errc why) {
    if (state_ != state::closed) {
        state_ = state::closed;
        deadlines_.disarm(*this);
        host_.unbind(*this);
        if (is_linked()) {
            unlink();
        }
    }
    auto& completions = completions_; // the first of the operations may destroy this
    auto first = std::move(first_);
    auto next = mail_.close();
    if (first != nullptr) {
        completions.fail(std::move(first), why, "the feed was closed");
    }
    if (next != nullptr) {
        completions.fail(std::move(next), why, "the feed was closed");
    }
}

} // namespace cles::core
