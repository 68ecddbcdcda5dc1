// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/stream_half.hpp"

#include <cles/error.hpp>

#include <algorithm>
#include <cstring>

namespace cles::simulation {

stream_half::stream_half(network& net, const std::shared_ptr<place>& home, const limits& bounds, unsigned peer_host)
    : net_(net), home_(home), host_(home->host()), peer_host_(peer_host),
      name_(home->name()), who_{.transport = net.secured() ? "tls" : "tcp",
                                .address = net.url_of(peer_host, carrier::stream),
                                .name = {},
                                .uid = {},
                                .local = true},
      bounds_(bounds), input_(bounds.line) {}

// One that was not accepted before its process ended.
stream_half::~stream_half() {
    if (state_ != state::closed && !severed_) {
        reset_peer();
    }
}

std::pair<std::shared_ptr<stream_half>, std::shared_ptr<stream_half>>
stream_half::make(network& net, const std::shared_ptr<place>& near, const limits& near_bounds,
                  const std::shared_ptr<place>& far, const limits& far_bounds) {
    auto a = std::make_shared<stream_half>(net, near, near_bounds, far->host());
    auto b = std::make_shared<stream_half>(net, far, far_bounds, near->host());
    a->peer_ = b;
    b->peer_ = a;
    return {a, b};
}

// -- admission -----------------------------------------------------------------------------------------------------

void stream_half::open(link_security& own, std::string_view expected, std::function<void(bool)> opened) {
    constexpr std::chrono::seconds most{5};
    opened_ = std::move(opened);
    opening_ = true;
    const auto home = home_.lock();
    const auto peer = peer_.lock();
    const auto peer_home = peer == nullptr ? nullptr : peer->home_.lock();
    if (peer_home == nullptr || peer_home->security() == nullptr) { // not TLS
        home->later({}, [self = shared_from_this()] { self->cut(); });
        return;
    }
    gate_ = own.make_gate(expected);
    std::string first;
    gate_->begin(peer_home->security()->own_key(), first);
    transmit(first);
    home->later(most, [weak = weak_from_this()] {
        if (const auto self = weak.lock(); self && self->opening_) {
            self->lose();
        }
    });
    home->later({}, [self = shared_from_this()] { self->admit(); });
}

// Takes the lines that have arrived, up to the peer's welcome.
void stream_half::admit() {
    const auto keep = shared_from_this();
    while (opening_ && gate_ && state_ == state::open) {
        input_.set_limit(gate_->max_line());
        std::string_view line;
        const auto found = input_.next(line);
        if (found == protocol::line_buffer::status::overlong) {
            lose();
        } else if (found == protocol::line_buffer::status::line) {
            net_.watcher().saw(name_, "<--", line);
            std::string reply;
            const auto verdict = gate_->on_line(line, reply);
            transmit(reply);
            if (verdict == stream_gate::verdict::admitted) {
                on_admitted();
            } else if (verdict == stream_gate::verdict::refused) {
                transmit_end();
                lose();
            }
        } else if (!fill()) {
            if (ended_) {
                lose();
            }
            return;
        }
    }
}

void stream_half::on_admitted() {
    opening_ = false;
    input_.set_limit(bounds_.line);
    who_.name = gate_->name();
    gate_->watch([this] {
        removed_ = true;
        if (const auto home = home_.lock()) {
            home->later({}, if_alive(weak_from_this(), [](stream_half& self) { self.lose(); }));
        }
    });
    flush();
    call_later({}, &stream_half::hand_over);
    if (const auto opened = std::exchange(opened_, nullptr)) {
        opened(true);
    }
}

void stream_half::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    call_later({}, &stream_half::hand_over);
}

// In an event of its own, unless the process has ended.
void stream_half::call_later(std::chrono::nanoseconds by, void (stream_half::*what)()) {
    if (const auto home = home_.lock()) {
        home->later(by, [self = shared_from_this(), what] { ((*self).*what)(); });
    }
}

// -- reading -------------------------------------------------------------------------------------------------------

void stream_half::arrive(std::string_view bytes) {
    net_.count(bytes, in_routes_);
    if (severed_) {
        return;
    }
    if (state_ == state::closed) {
        reset_peer();
        return;
    }
    if (state_ == state::discarding || state_ == state::finishing) {
        taken(bytes.size());
        return;
    }
    if (inbox_at_ > window) {
        inbox_.erase(0, inbox_at_);
        inbox_at_ = 0;
    }
    inbox_.append(bytes);
    hand_over();
}

void stream_half::arrive_end() {
    if (severed_ || state_ == state::closed) {
        return;
    }
    ended_ = true;
    if (state_ == state::discarding) {
        lose();
    } else if (state_ == state::open) {
        hand_over();
    }
}

void stream_half::arrive_reset() {
    if (!severed_) {
        lose();
    }
}

// Notifies the peer that this much has been read.
void stream_half::taken(std::size_t bytes) {
    received_ += bytes;
    const auto peer = peer_.lock();
    if (peer == nullptr) {
        return;
    }
    peer->in_flight_ -= std::min(bytes, peer->in_flight_);
    if (const auto home = peer->home_.lock(); home && peer->blocked_) {
        peer->blocked_ = false;
        home->at_true(net_.arrival(host_, peer_host_), [peer] { peer->write_rest(); });
    }
}

// Reads what has arrived. False: nothing.
bool stream_half::fill() {
    const auto left = inbox_.size() - inbox_at_;
    if (left == 0) {
        inbox_.clear();
        inbox_at_ = 0;
        return false;
    }
    const auto space = input_.prepare();
    const auto size = std::min(space.size(), left);
    std::memcpy(space.data(), inbox_.data() + inbox_at_, size);
    input_.commit(size);
    inbox_at_ += size;
    taken(size);
    return true;
}

void stream_half::hand_over() {
    if (opening_) {
        admit();
    }
    if (opening_ || removed_ || handing_ || overlong_ || owner_ == nullptr) {
        return;
    }
    const auto keep = shared_from_this();
    while (state_ == state::open && !paused_) {
        if (!lines_left_ && !fill() && told_end_) {
            return;
        }
        handing_ = true;
        lines_left_ = hand_over_batch();
        handing_ = false;
        if (!lines_left_ && inbox_at_ == inbox_.size()) {
            break;
        }
    }
    if (state_ == state::finishing || state_ == state::discarding) {
        taken(inbox_.size() - inbox_at_);
        inbox_.clear();
        inbox_at_ = 0;
    }
}

// True if there may be further lines.
bool stream_half::hand_over_batch() {
    const auto owner = owner_;
    bool more = true;
    while (more && !paused_ && state_ == state::open && !removed_) {
        std::string_view line;
        switch (input_.next(line)) {
        case protocol::line_buffer::status::line:
            net_.watcher().saw(name_, "<--", line);
            owner->on_line(line);
            break;
        case protocol::line_buffer::status::overlong:
            overlong_ = true;
            more = false;
            owner->on_overlong(line);
            break;
        case protocol::line_buffer::status::need_more: more = false; break;
        }
    }
    if (state_ == state::open && !more && ended_ && inbox_at_ == inbox_.size() && !told_end_ && !overlong_) {
        told_end_ = true;
        if (const auto rest = input_.unfinished(); !rest.empty()) {
            owner->on_cut(rest);
        }
        if (state_ == state::open) {
            owner->on_end();
        }
    }
    if (state_ != state::closed) {
        owner->on_batch();
    }
    return more && !overlong_;
}

void stream_half::pause(bool stop) {
    if (net_.fault() == planted::never_full) {
        return;
    }
    if (paused_ != stop) {
        paused_ = stop;
        if (!stop && !handing_ && state_ == state::open) {
            call_later({}, &stream_half::hand_over);
        }
    }
}

// -- writing -------------------------------------------------------------------------------------------------------

void stream_half::tamper() { net_.tampered.apply(output_, home_, net_.chance_between(host_, peer_host_)); }

void stream_half::flush() {
    if (state_ == state::closed || state_ == state::discarding || shut_ || opening_ || removed_ || !sending_.empty()) {
        return;
    }
    if (net_.fault() != planted::urgent_lost) {
        output_.insert(0, urgent_);
    }
    urgent_.clear();
    if (output_.empty()) {
        return;
    }
    tamper();
    report_updates(output_);
    const auto count = std::min(free_window(), output_.size());
    transmit(std::string_view{output_}.substr(0, count));
    sent_ += count;
    if (count == output_.size()) {
        output_.clear();
        return;
    }
    sending_.swap(output_);
    sending_at_ = count;
    blocked_ = true;
}

void stream_half::write_rest() {
    if (state_ == state::closed || severed_ || sending_.empty()) {
        return;
    }
    const auto count = std::min(free_window(), sending_.size() - sending_at_);
    transmit(std::string_view{sending_}.substr(sending_at_, count));
    sent_ += count;
    sending_at_ += count;
    if (sending_at_ < sending_.size()) {
        blocked_ = true;
        return;
    }
    sending_.clear();
    sending_at_ = 0;
    flush();
    if (!sending_.empty()) {
        return;
    }
    if (state_ == state::finishing) {
        end_sending();
    } else if (const auto owner = owner_) {
        owner->on_writable();
    }
}

// What is sent to a member is checked against its rights.
void stream_half::report_updates(std::string_view lines) {
    const auto home = gate_ ? home_.lock() : nullptr;
    while (home && !lines.empty()) {
        const auto line = lines.substr(0, lines.find('\n'));
        lines.remove_prefix(std::min(line.size() + 1, lines.size()));
        if (line.starts_with("UPDATE ")) {
            home->on_link_sends(who_, line);
        }
    }
}

// In one piece or in several, split anywhere.
void stream_half::transmit(std::string_view bytes) {
    if (bytes.empty()) {
        return;
    }
    net_.watcher().saw(name_, "==>", bytes);
    net_.stream_bytes += bytes.size();
    const auto peer = peer_.lock();
    const auto home = peer == nullptr ? nullptr : peer->home_.lock();
    if (home == nullptr) {
        if (const auto own = home_.lock()) {
            own->at_true(net_.arrival(host_, peer_host_), [self = shared_from_this()] { self->arrive_reset(); });
        }
        return;
    }
    in_flight_ += bytes.size();
    while (!bytes.empty()) {
        auto& chance = net_.chance_between(host_, peer_host_);
        const auto whole = static_cast<unsigned>(bytes.size());
        const auto size = chance.chance(150) ? 1 + chance.below(whole) : whole;
        const auto when = in_order(net_.arrival(host_, peer_host_));
        home->at_true(when, [peer, piece = std::string{bytes.substr(0, size)}] { peer->arrive(piece); });
        bytes.remove_prefix(size);
    }
}

void stream_half::transmit_end() {
    if (shut_) {
        return;
    }
    shut_ = true;
    net_.watcher().saw(name_, "==> end");
    const auto peer = peer_.lock();
    if (const auto home = peer == nullptr ? nullptr : peer->home_.lock()) {
        home->at_true(in_order(net_.arrival(host_, peer_host_)), [peer] { peer->arrive_end(); });
    }
}

void stream_half::reset_peer() {
    const auto peer = peer_.lock();
    if (const auto home = peer == nullptr ? nullptr : peer->home_.lock()) {
        home->at_true(net_.arrival(host_, peer_host_), [peer] { peer->arrive_reset(); });
    }
}

// -- ending --------------------------------------------------------------------------------------------------------

void stream_half::half_close() {
    flush();
    if (state_ == state::open && sending_.empty()) {
        transmit_end();
    }
}

void stream_half::finish() {
    if (state_ != state::open) {
        return;
    }
    flush();
    if (net_.fault() == planted::finish_resets) {
        cut();
        return;
    }
    state_ = state::finishing;
    if (sending_.empty()) {
        end_sending();
    }
}

void stream_half::end_sending() {
    state_ = state::discarding;
    transmit_end();
    call_later(ended_ ? std::chrono::milliseconds{0} : bounds_.discard, &stream_half::lose);
}

void stream_half::cut() {
    const auto sever = [this](stream_half& half) {
        if (half.severed_ || half.state_ == state::closed) {
            return;
        }
        half.severed_ = true;
        half.shut_ = true;
        if (!half.home_.expired()) {
            half.call_later(net_.chance_between(half.host_, half.peer_host_).within(std::chrono::milliseconds{5}),
                            &stream_half::lose);
        }
    };
    net_.watcher().saw(name_, "is cut");
    if (const auto peer = peer_.lock()) {
        sever(*peer);
    }
    sever(*this);
}

void stream_half::lose() {
    if (state_ == state::closed) {
        return;
    }
    const auto keep = shared_from_this();
    const auto owner = owner_;
    const auto opened = std::exchange(opened_, nullptr);
    close();
    if (opened) {
        opened(false);
    }
    if (owner) {
        owner->on_lost(make_error_code(errc::unavailable));
    }
}

void stream_half::close() {
    if (state_ == state::closed) {
        return;
    }
    const auto keep = weak_from_this().lock();
    opened_ = nullptr;
    const bool unread = inbox_at_ < inbox_.size();
    state_ = state::closed;
    owner_.reset();
    if (severed_ || !keep) {
        return;
    }
    if (unread || !sending_.empty()) {
        shut_ = true;
        reset_peer();
    } else {
        transmit_end();
    }
}

} // namespace cles::simulation
