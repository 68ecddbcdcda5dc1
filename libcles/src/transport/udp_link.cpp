// SPDX-License-Identifier: BSL-1.0
#include "transport/udp_link.hpp"

#include "transport/udp_port.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>

#include <utility>

namespace cles::transport {

udp_link::udp_link(std::shared_ptr<udp_port> socket, boost::asio::ip::udp::endpoint peer, identity who)
    : port_(std::move(socket)), peer_(std::move(peer)), who_(std::move(who)) {}

udp_link::~udp_link() { udp_link::close(); }

void udp_link::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    if (port_ == nullptr) {
        return;
    }
    port_->receive();
    if (!early_.empty()) {
        boost::asio::post(port_->executor(), [self = shared_from_this()] {
            for (const auto& datagram : std::exchange(self->early_, {})) {
                self->deliver(datagram);
            }
        });
    }
}

void udp_link::deliver(std::string_view datagram) {
    if (port_ == nullptr) {
        return;
    }
    if (owner_ == nullptr) {
        constexpr std::size_t most_early = 16;
        if (early_.size() < most_early) {
            early_.emplace_back(datagram);
        }
        return;
    }
    received_ += datagram.size();
    if (paused_) {
        return;
    }
    const auto owner = owner_; // which may close the link
    if (datagram.size() > protocol::datagram_bytes) {
        owner->on_overlong(datagram.substr(0, protocol::datagram_bytes));
    } else {
        if (datagram.ends_with('\n')) {
            datagram.remove_suffix(1);
        }
        owner->on_line(datagram);
    }
    if (port_ != nullptr) {
        owner->on_batch();
    }
}

void udp_link::flush() {
    if (port_ == nullptr || output_.empty()) {
        return;
    }
    take_output();
    send_rest();
}

// All of it at once: the flushing code relies on it that what it finds here next time is new.
void udp_link::take_output() {
    if (sending_.empty()) {
        sending_.swap(output_);
        sending_at_ = 0;
        return;
    }
    if (sending_at_ > sending_.size() / 2) {
        sending_.erase(0, sending_at_);
        sending_at_ = 0;
    }
    sending_.append(output_);
    output_.clear();
}

void udp_link::send_rest() {
    while (!waiting_ && sending_at_ < sending_.size()) {
        const auto done = port_->send(*this, std::string_view{sending_}.substr(sending_at_));
        if (done.lines == 0) {
            waiting_ = true;
            port_->wait_for_room(weak_from_this());
            return;
        }
        sent_ += done.bytes;
        sending_at_ += done.bytes;
    }
    if (waiting_) {
        return;
    }
    constexpr std::size_t largest_kept = 65536;
    if (sending_.capacity() > largest_kept) {
        std::string{}.swap(sending_); // an empty one that is assigned would keep the memory
    }
    sending_.clear();
    sending_at_ = 0;
}

void udp_link::on_room() {
    waiting_ = false;
    if (port_ == nullptr) {
        return;
    }
    send_rest();
    if (const auto owner = owner_; owner && sending_.empty()) {
        owner->on_room();
    }
}

// There is nobody to say goodbye to.
void udp_link::finish() {
    if (port_ == nullptr) {
        return;
    }
    flush();
    boost::asio::post(port_->executor(), [self = shared_from_this()] {
        const auto owner = self->owner_;
        if (self->port_ != nullptr) {
            self->close();
            if (owner) {
                owner->on_lost(boost::asio::error::eof);
            }
        }
    });
}

void udp_link::shrink() {
    if (output_.empty() && sending_.empty()) {
        std::string{}.swap(output_);
        std::string{}.swap(sending_);
    }
}

void udp_link::close() {
    if (const auto port = std::exchange(port_, nullptr)) {
        owner_.reset();
        port->forget(*this);
    }
}

} // namespace cles::transport
