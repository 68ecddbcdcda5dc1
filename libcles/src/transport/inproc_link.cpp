// SPDX-License-Identifier: BSL-1.0
#include "transport/inproc_link.hpp"

#include "transport/transports.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <algorithm>
#include <string_view>
#include <utility>

namespace cles::transport {
namespace asio = boost::asio;

inproc_link::inproc_link(asio::any_io_executor executor, std::string address, const limits& bounds)
    : executor_(std::move(executor)), peer_{.transport = "inproc",
                                            .address = std::move(address),
                                            .name = {},
                                            .uid = {},
                                            .local = true},
      bounds_(bounds), own_mailbox_(std::make_shared<mailbox>(executor_)), timeout_(executor_) {}

inproc_link::~inproc_link() { inproc_link::close(); }

void inproc_link::join(const std::shared_ptr<inproc_link>& a, const std::shared_ptr<inproc_link>& b) {
    a->other_ = b;
    b->other_ = a;
    a->peer_mailbox_ = b->own_mailbox_;
    b->peer_mailbox_ = a->own_mailbox_;
}

template <class F>
void inproc_link::post_to_peer(F action) {
    if (!peer_mailbox_) {
        return;
    }
    peer_mailbox_->post([weak = other_, action = std::move(action)]() mutable {
        if (const auto other = weak.lock()) {
            action(*other);
        }
    });
}

void inproc_link::start(std::shared_ptr<link_events> owner) {
    if (state_ == state::closed) {
        return;
    }
    owner_ = std::move(owner);
    if (state_ == state::fresh) {
        state_ = state::open;
    }
    peer_closed_ = peer_closed_ || other_.expired();
    if (!inbox_.empty() || ended_ || peer_closed_) {
        continue_later();
    }
}

// -- writing -------------------------------------------------------------------------------------------------------

void inproc_link::flush() {
    if (state_ == state::closed || state_ == state::finishing || output_.empty()) {
        return;
    }
    if (peer_closed_) { // reported later: the owner may be in the middle of something
        output_.clear();
        lose_later();
        return;
    }
    in_transit_ += output_.size();
    flushed_ += output_.size();
    post_to_peer([lines = std::exchange(output_, {})](inproc_link& other) mutable { other.receive(std::move(lines)); });
}

void inproc_link::consumed(std::size_t bytes) {
    const bool was_full = on_its_way() != 0;
    in_transit_ -= bytes;
    if (!was_full || on_its_way() != 0) {
        return;
    }
    if (state_ == state::finishing) {
        wait_for_peer_close();
    } else if (const auto owner = owner_) {
        owner->on_room();
    }
}

// -- reading -------------------------------------------------------------------------------------------------------

void inproc_link::receive(std::string lines) {
    if (state_ == state::closed) {
        return;
    }
    received_ += lines.size();
    if (state_ == state::finishing || overlong_) {
        release(lines.size());
        return;
    }
    inbox_.push_back(std::move(lines));
    hand_over();
}

// Notifies the other end that this much has been read.
void inproc_link::release(std::size_t bytes) {
    if (bytes != 0 && state_ != state::closed) {
        post_to_peer([bytes](inproc_link& other) { other.consumed(bytes); });
    }
}

void inproc_link::discard_input() {
    if (handing_) {
        return; // a line of it is being processed further up the stack
    }
    auto bytes = text_.size();
    for (const auto& text : inbox_) {
        bytes += text.size();
    }
    inbox_.clear();
    text_.clear();
    read_at_ = 0;
    release(bytes);
}

// Makes the next text the current one. Returns false if none is left.
bool inproc_link::next_text() {
    if (read_at_ < text_.size()) {
        return true;
    }
    release(text_.size());
    text_.clear();
    read_at_ = 0;
    if (inbox_.empty()) {
        std::string{}.swap(text_); // frees its memory
        return false;
    }
    text_ = std::move(inbox_.front());
    inbox_.pop_front();
    return true;
}

void inproc_link::hand_over_batch() {
    const auto owner = owner_;
    hand_over_lines();
    if (state_ == state::open && ended_ && !end_reported_ && !overlong_ && !paused_ && drained()) {
        end_reported_ = true;
        owner->on_end();
    }
    if (state_ != state::closed) {
        owner->on_batch();
    }
}

void inproc_link::hand_over_lines() {
    const auto owner = owner_;
    for (int turn = lines_per_turn; turn > 0 && !paused_ && state_ == state::open && next_text(); --turn) {
        const auto end = std::min(text_.find('\n', read_at_), text_.size());
        const auto line = std::string_view{text_}.substr(read_at_, end - read_at_);
        if (line.size() > bounds_.line) {
            overlong_ = true;
            owner->on_overlong(line.substr(0, bounds_.line));
            return;
        }
        read_at_ = std::min(end + 1, text_.size());
        owner->on_line(line);
    }
}

void inproc_link::hand_over() {
    if (handing_ || state_ != state::open || !owner_) {
        return;
    }
    const auto self = shared_from_this();
    handing_ = true;
    try {
        hand_over_batch();
    } catch (...) { // of a handler, for the thread that runs the context; the other lines are not affected
        handing_ = false;
        continue_later();
        throw;
    }
    handing_ = false;
    if (state_ != state::open || overlong_) {
        discard_input();
    } else if (!paused_ && !drained()) {
        continue_later();
    } else if (drained()) {
        next_text(); // releases the last one
    }
    if (peer_closed_ && state_ == state::open && (overlong_ || (!paused_ && drained()))) {
        lose();
    }
}

void inproc_link::continue_later() {
    if (!posted_) {
        posted_ = true;
        asio::post(executor_, [self = shared_from_this()] {
            self->posted_ = false;
            if (self->state_ == state::open) {
                self->hand_over();
            } else if (self->state_ == state::finishing) {
                self->discard_input();
            }
        });
    }
}

void inproc_link::pause(bool stop) {
    if (paused_ != stop) {
        paused_ = stop;
        if (!stop && !handing_) {
            continue_later();
        }
    }
}

// -- ending --------------------------------------------------------------------------------------------------------

void inproc_link::finish() {
    if (state_ == state::closed || state_ == state::finishing) {
        return;
    }
    flush();
    state_ = state::finishing;
    discard_input();
    post_to_peer([](inproc_link& other) { other.on_other_finished(); });
    if (ended_ || peer_closed_) {
        lose_later();
    } else if (on_its_way() == 0) {
        wait_for_peer_close();
    }
}

void inproc_link::wait_for_peer_close() {
    timeout_.expires_after(bounds_.discard);
    timeout_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        if (!code) {
            self->lose();
        }
    });
}

void inproc_link::on_other_finished() {
    ended_ = true;
    if (state_ == state::finishing) {
        lose_later();
    } else {
        hand_over();
    }
}

// What the other end sent before it closed is still delivered, unless that could take for ever.
void inproc_link::on_other_closed() {
    peer_closed_ = true;
    const bool held_back = paused_ && unsent() != 0;
    if (state_ == state::finishing || (state_ == state::open && (overlong_ || held_back))) {
        lose();
    } else {
        hand_over();
    }
}

void inproc_link::lose_later() {
    asio::post(executor_, [self = shared_from_this()] { self->lose(); });
}

void inproc_link::lose() {
    if (state_ == state::closed) {
        return;
    }
    const auto owner = owner_;
    close();
    if (owner) {
        owner->on_lost(asio::error::eof);
    }
}

void inproc_link::close() {
    if (state_ == state::closed) {
        return;
    }
    state_ = state::closed;
    timeout_.cancel();
    discard_input();
    owner_.reset();
    own_mailbox_->shut();
    post_to_peer([](inproc_link& other) { other.on_other_closed(); });
}

} // namespace cles::transport
