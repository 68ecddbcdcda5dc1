// SPDX-License-Identifier: BSL-1.0
#include "core/feed_machine.hpp"

#include "core/later.hpp"
#include "protocol/message.hpp"

#include <utility>

namespace cles::core {

feed_machine::feed_machine(feed_host& host, deadline_queue& deadlines, completion_queue& completions,
                           const limits& bounds, std::string target, std::string path, bool thinned, std::uint32_t seed)
    : subscription(std::move(target), std::move(path), thinned, bounds.publishers), host_(host), deadlines_(deadlines),
      longest_(bounds.line), completions_(completions), mail_(bounds, completions), backoff_(seed),
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
    // The events are queued before the caller learns that it is bound, so that it finds them in their order.
    const std::string body{last};
    if (was_bound_) {
        mail_.put({.kind = feed_event::rebound});
    }
    was_bound_ = true;
    if (mark) {
        take_marked(body, *mark);
        if (state_ != state::bound) { // the handler that took it has closed the feed
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

// As if the publisher had sent it once more: it is dropped where it has come before, shows a gap, or another run.
void feed_machine::take_marked(const std::string& body, const update_mark& mark) {
    std::string line;
    protocol::append_update_head(line, target(), path(), mark.seq, protocol::epoch_text(mark.epoch));
    line.append(body);
    protocol::request_line update;
    protocol::malformed_request ignored;
    if (line.size() <= longest_ && protocol::parse_request(line, update, ignored)) {
        take(update);
    }
}

void feed_machine::on_leased(time_point asked, std::chrono::milliseconds lease) {
    if (state_ == state::bound) {
        bound_at_ = asked;
        renewal_.begin(asked, lease);
    }
}

void feed_machine::on_renewed(time_point asked) {
    if (state_ == state::bound && asked >= bound_at_) {
        renewal_.renewed(asked);
    }
}

void feed_machine::on_renewal_refused(time_point asked, boost::system::error_code why, std::string_view message,
                                      time_point now) {
    if (state_ != state::bound || asked < bound_at_) { // of a binding that is no more
        return;
    }
    if (why == errc::too_large) { // the publisher has renewed it; only its last value did not fit the answer
        on_renewed(asked);
    } else if (why != errc::busy || !renewal_.put_off(now)) {
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
    deadlines_.arm(*this, later(now, backoff_.next()));
}

void feed_machine::hurry(time_point now) {
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
