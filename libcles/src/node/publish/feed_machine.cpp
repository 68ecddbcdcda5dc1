// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_machine.hpp"

#include "node/base/deadlines.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <utility>

namespace cles::core {

feed_machine::feed_machine(feed_host& host, deadline_queue& deadlines, completion_queue& completions,
                           const limits& bounds, std::string target, std::string path, bool thinned, std::uint32_t seed)
    : subscription(std::move(target), std::move(path), thinned, bounds.publishers), host_(host), deadlines_(deadlines),
      max_line_(bounds.line), completions_(completions), mail_(bounds, completions), backoff_(seed),
      renewal_(*this, deadlines, ~seed) {}

void feed_machine::start(detail::pending_ptr bound) {
    first_ = std::move(bound);
    state_ = state::binding;
    host_.bind(*this);
}

void feed_machine::on_bound(std::string_view last, const std::optional<update_mark>& mark) {
    if (state_ != state::binding) {
        return;
    }
    state_ = state::bound;
    backoff_.reset();
    // The events are queued before the caller's operation completes, so that it finds them in order.
    const std::string body{last};
    if (was_bound_) {
        mail_.put({.kind = feed_event::rebound});
    }
    was_bound_ = true;
    if (mark) {
        take_marked(body, *mark);
        if (state_ != state::bound) { // its handler has closed the feed
            return;
        }
    }
    if (body != "{}") {
        mail_.put({.kind = feed_event::current, .body = body, .checked = true});
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

void feed_machine::on_leased(time_point sent_at, std::chrono::milliseconds lease) {
    if (state_ == state::bound) {
        bound_at_ = sent_at;
        renewal_.begin(sent_at, lease);
    }
}

void feed_machine::on_renewed(time_point sent_at) {
    if (state_ == state::bound && sent_at >= bound_at_) {
        renewal_.renewed(sent_at);
    }
}

void feed_machine::on_renewal_refused(time_point sent_at, boost::system::error_code why, std::string_view message,
                                      time_point now) {
    if (state_ != state::bound || sent_at < bound_at_) { // of an earlier binding
        return;
    }
    if (why == errc::too_large) { // it is renewed: only the last value did not fit into the reply
        on_renewed(sent_at);
    } else if (why != errc::busy || !renewal_.retry_later(now)) {
        const std::string text{why == errc::deadline ? "the publisher did not renew the lease in time" : message};
        host_.detach(*this);
        on_lost(text, now);
    }
}

void feed_machine::on_refused(boost::system::error_code why, std::string_view message, time_point now) {
    if (state_ != state::binding) {
        return;
    }
    if (first_) {
        auto operation = std::move(first_);
        const std::string text{message};
        close(errc::cancelled);
        completions_.fail(std::move(operation), why, text);
        return;
    }
    pause(now);
}

void feed_machine::on_lost(std::string_view why, time_point now) {
    if (state_ != state::bound) {
        return;
    }
    pause(now);
    mail_.put({.kind = feed_event::lost, .text = why});
}

void feed_machine::pause(time_point now) {
    state_ = state::pausing;
    renewal_.stop();
    deadlines_.arm(*this, saturating_add(now, backoff_.next()));
}

void feed_machine::expedite(time_point now) {
    if (state_ == state::pausing) {
        backoff_.reset();
        deadlines_.arm(*this, now);
    }
}

void feed_machine::on_deadline(time_point) {
    if (state_ == state::pausing) {
        state_ = state::binding;
        host_.bind(*this);
    }
}

void feed_machine::close(errc why) { abandon().fail(completions_, why); }

feed_machine::waiting feed_machine::abandon() {
    if (state_ != state::closed) {
        state_ = state::closed;
        deadlines_.disarm(*this);
        renewal_.stop();
        host_.unbind(*this);
    }
    return {.first = std::move(first_), .next = mail_.close()};
}

void feed_machine::waiting::fail(completion_queue& completions, errc why) {
    if (first != nullptr) {
        completions.fail(std::move(first), why, "the feed was closed");
    }
    if (next != nullptr) {
        completions.fail(std::move(next), why, "the feed was closed");
    }
}

} // namespace cles::core
