// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/datagram_port.hpp"

#include <cles/error.hpp>

#include "protocol/request_line.hpp"

#include <utility>

namespace cles::simulation {

link_ptr datagram_port::connect(const endpoint& peer) {
    auto made = std::make_shared<datagram_link>(shared_from_this(), peer, false);
    links_[peer] = made;
    return made;
}

void datagram_port::receive(const endpoint& from, const std::string& datagram) {
    if (const auto home = home_.lock()) {
        home->receive([self = shared_from_this(), from, datagram] { self->hand_over(from, datagram); });
    }
}

void datagram_port::hand_over(const endpoint& from, const std::string& datagram) {
    auto found = links_[from].lock();
    if (!found) {
        if (!on_link_) {
            links_.erase(from);
            return;
        }
        found = std::make_shared<datagram_link>(shared_from_this(), from, strangers_);
        links_[from] = found;
        on_link_(found);
        if (net_.fault() == planted::source_kept) {
            keep(from);
        }
    }
    found->deliver(datagram);
}

// Repeatedly delivers an empty line from this source.
void datagram_port::keep(const endpoint& source) {
    constexpr std::chrono::seconds often{20};
    if (const auto home = home_.lock()) {
        home->later(often, [weak = weak_from_this(), source] {
            const auto self = weak.lock();
            if (const auto link = self ? self->links_[source].lock() : nullptr) {
                link->deliver("\n");
                self->keep(source);
            }
        });
    }
}

datagram_link::datagram_link(std::shared_ptr<datagram_port> port, const endpoint& peer, bool stranger)
    : port_(std::move(port)), peer_(peer), who_{.transport = "udp",
                                                .address = "udp://" + to_string(peer),
                                                .name = {},
                                                .uid = {},
                                                .local = !stranger} {}

std::size_t datagram_link::datagram() const noexcept {
    const bool lies = port_ != nullptr && port_->net_.fault() == planted::datagram_long;
    return protocol::datagram_bytes + (lies ? 300 : 0);
}

void datagram_link::deliver(std::string_view datagram) {
    if (port_ == nullptr || owner_ == nullptr || paused_) {
        return;
    }
    received_ += datagram.size();
    port_->net_.watcher().saw(to_string(port_->local_), "<--", datagram);
    const auto owner = owner_; // which may close the link
    const auto keep = shared_from_this();
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

void datagram_link::flush() {
    if (port_ == nullptr || output_.empty()) {
        return;
    }
    const auto text = std::exchange(output_, {});
    sent_ += text.size();
    for (std::size_t at = 0; at < text.size();) {
        const auto size = text.find('\n', at) + 1 - at;
        const auto line = std::string_view{text}.substr(at, size);
        port_->net_.watcher().saw(to_string(port_->local_), "-->", line);
        port_->net_.send(port_->local_, peer_, line);
        at += size;
    }
}

void datagram_link::finish() {
    flush();
    if (const auto home = port_ == nullptr ? nullptr : port_->home_.lock()) {
        home->later({}, [self = shared_from_this()] {
            if (self->port_ != nullptr) {
                const auto owner = self->owner_;
                self->close();
                if (owner) {
                    owner->on_lost(make_error_code(errc::unavailable));
                }
            }
        });
    }
}

void datagram_link::close() {
    const auto keep = weak_from_this().lock();
    if (const auto port = std::exchange(port_, nullptr)) {
        port->links_.erase(peer_);
        owner_.reset();
    }
}

} // namespace cles::simulation
