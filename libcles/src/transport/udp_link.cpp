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
    if (port_ == nullptr || output_.empty() || !sending_.empty()) {
        return;
    }
    sending_.swap(output_);
    sending_at_ = 0;
    send_rest();
}

void udp_link::send_rest() {
    while (sending_at_ < sending_.size()) {
        const auto done = port_->send(*this, std::string_view{sending_}.substr(sending_at_));
        if (done.lines == 0) {
            if (!waiting_) {
                waiting_ = true;
                port_->wait_for_room(weak_from_this());
            }
            return;
        }
        sent_ += done.bytes;
        sending_at_ += done.bytes;
    }
    constexpr std::size_t largest_kept = 65536;
    if (sending_.capacity() > largest_kept) {
        sending_ = {};
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
    if (sending_.empty()) {
        flush();
    }
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

void udp_link::close() {
    if (const auto port = std::exchange(port_, nullptr)) {
        owner_.reset();
        port->forget(*this);
    }
}

} // namespace cles::transport
