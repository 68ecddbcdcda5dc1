// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/datagram_port.hpp"

#include <cles/error.hpp>

#include "protocol/request_line.hpp"

#include <utility>

namespace cles::simulation {

namespace {

transport::datagram_codec::endpoint udp_endpoint_of(const endpoint& at) {
    return {boost::asio::ip::address_v4{address_of(at.host)}, static_cast<std::uint16_t>(at.port)};
}
endpoint endpoint_of(const transport::datagram_codec::endpoint& at) {
    return {at.address().to_v4().to_uint() - address_of(0), at.port()};
}
datagram_peer peer_of(const transport::datagram_origin& o) { return {endpoint_of(o.at), o.member}; }
transport::datagram_origin origin_of(const datagram_peer& p) { return {udp_endpoint_of(p.at), p.member}; }

bool is_sealed(std::string_view datagram) {
    return !datagram.empty() && static_cast<unsigned char>(datagram[0]) >= 0x80;
}

} // namespace

datagram_port::datagram_port(network& net, const std::shared_ptr<place>& home, endpoint local, bool strangers,
                             std::unique_ptr<transport::datagram_codec> codec)
    : net_(net), home_(home), local_(local), name_(to_string(local)), strangers_(strangers), codec_(std::move(codec)) {
    if (codec_) {
        codec_->start(*this);
    }
}

datagram_port::~datagram_port() { end(); }

void datagram_port::end() {
    home_.reset();
    if (codec_) {
        codec_->stop();
    }
}

link_ptr datagram_port::connect(const endpoint& peer, std::uint32_t member) {
    const datagram_peer who{peer, member};
    auto made = std::make_shared<datagram_link>(shared_from_this(), who, false);
    links_[who] = made;
    dialled_ = true;
    return made;
}

void datagram_port::receive(const endpoint& from, const std::string& datagram) {
    if (const auto home = home_.lock()) {
        home->receive([self = shared_from_this(), from, datagram] { self->hand_over(from, datagram); });
    }
}

void datagram_port::hand_over(const endpoint& from, const std::string& datagram) {
    if (!codec_) {
        deliver({from, 0}, 0, datagram);
        return;
    }
    if (home_.expired()) {
        return;
    }
    if (net_.fault() == planted::forgery_taken || net_.fault() == planted::replay_taken) {
        take_forgery(from, datagram);
    }
    raw_ = datagram;
    codec_->receive(udp_endpoint_of(from), datagram);
    raw_ = {};
}

std::shared_ptr<datagram_link> datagram_port::find(const datagram_peer& from) const {
    const auto found = links_.find(from);
    return found == links_.end() ? nullptr : found->second.lock();
}

std::shared_ptr<datagram_link> datagram_port::accept(const datagram_peer& from) {
    if (!on_link_) {
        links_.erase(from);
        return nullptr;
    }
    auto made = std::make_shared<datagram_link>(shared_from_this(), from, strangers_);
    links_[from] = made;
    return made;
}

void datagram_port::deliver(const datagram_peer& from, std::uint32_t epoch, std::string_view line) {
    auto link = find(from);
    const bool is_new = link == nullptr;
    if (is_new) {
        link = accept(from);
    }
    if (!link) {
        return;
    }
    if (codec_) {
        link->note_epoch(epoch);
    }
    if (is_new) {
        on_link_(link);
        if (net_.fault() == planted::source_kept) {
            keep(from);
        }
    }
    link->deliver(line);
}

// Repeatedly delivers an empty line from this source.
void datagram_port::keep(const datagram_peer& source) {
    constexpr std::chrono::seconds often{20};
    if (const auto home = home_.lock()) {
        home->later(often, [weak = weak_from_this(), source] {
            const auto self = weak.lock();
            if (const auto link = self ? self->find(source) : nullptr) {
                link->deliver("\n");
                self->keep(source);
            }
        });
    }
}

void datagram_port::send(const datagram_peer& to, std::string_view line) {
    if (codec_) {
        codec_->send(origin_of(to), line.substr(0, line.size() - 1));
    } else {
        net_.send(local_, to.at, line);
    }
}

// -- with security -------------------------------------------------------------------------------------------------

void datagram_port::transmit(const udp_endpoint& to, std::string_view datagram) {
    if (!home_.expired()) {
        net_.send(local_, endpoint_of(to), datagram);
    }
}

void datagram_port::on_opened(const transport::datagram_origin& from, std::uint32_t epoch, std::string_view line) {
    if (net_.fault() == planted::replay_taken) {
        taken_.emplace(raw_, std::pair{peer_of(from), std::string{line}});
    }
    deliver(peer_of(from), epoch, line);
}

// What a planted fault delivers although nobody has proved to have sent it: a line that is not sealed, or a repeated
// datagram.
void datagram_port::take_forgery(const endpoint& from, std::string_view datagram) {
    if (const auto known = taken_.find(std::string{datagram}); known != taken_.end()) {
        deliver(known->second.first, 0, known->second.second);
    } else if (net_.fault() == planted::forgery_taken && !is_sealed(datagram)) {
        deliver({from, from.host + 1}, 0, datagram);
    }
}

void datagram_port::on_established(const transport::datagram_origin& with, std::uint32_t epoch) {
    if (const auto link = find(peer_of(with)); link && link->note_epoch(epoch)) {
        if (!dialled_) {
            link->lose();
        } else if (const auto owner = link->owner()) {
            owner->on_restart();
        }
    }
}

void datagram_port::on_unanswered(const transport::datagram_origin& with, bool lost) {
    const auto link = find(peer_of(with));
    if (const auto owner = link ? link->owner() : nullptr) {
        owner->on_unanswered(lost);
    }
}

void datagram_port::on_removed(std::uint32_t member) {
    const auto home = home_.lock();
    for (const auto& [peer, weak] : links_) {
        if (home && peer.member == member) {
            home->later({}, [weak] {
                if (const auto link = weak.lock()) {
                    link->lose();
                }
            });
        }
    }
}

bool datagram_port::holds(const transport::datagram_origin& which) const { return find(peer_of(which)) != nullptr; }

// -- links ---------------------------------------------------------------------------------------------------------

datagram_link::datagram_link(std::shared_ptr<datagram_port> port, const datagram_peer& peer, bool stranger)
    : port_(std::move(port)), peer_(peer), who_{.transport = "udp",
                                                .address = "udp://" + to_string(peer.at),
                                                .name = {},
                                                .uid = {},
                                                .local = !stranger} {
    if (port_->codec_) {
        who_.name = port_->codec_->name_of(peer.member);
    }
}

bool datagram_link::note_epoch(std::uint32_t epoch) {
    const auto before = std::exchange(epoch_, protocol::epoch_text(epoch));
    return !before.empty() && before != epoch_;
}

void datagram_link::check_peer(time_point since) {
    if (port_ != nullptr && port_->codec_) {
        port_->codec_->check_peer(origin_of(peer_), since);
    }
}

void datagram_link::lose() {
    const auto owner = owner_;
    const auto keep = weak_from_this().lock();
    if (port_ != nullptr) {
        close();
        if (owner) {
            owner->on_lost(make_error_code(errc::unavailable));
        }
    }
}

std::size_t datagram_link::datagram() const noexcept {
    const bool lies = port_ != nullptr && port_->net_.fault() == planted::datagram_long;
    return protocol::datagram_bytes + (lies ? 300 : 0);
}

void datagram_link::deliver(std::string_view datagram) {
    if (port_ == nullptr || owner_ == nullptr || paused_) {
        return;
    }
    received_ += datagram.size();
    if (const auto home = port_->codec_ ? port_->home_.lock() : nullptr) {
        home->on_link_receives(who_, datagram);
    }
    port_->net_.watcher().saw(port_->name_, "<--", datagram);
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
        port_->net_.watcher().saw(port_->name_, "-->", line);
        if (const auto home = port_->codec_ ? port_->home_.lock() : nullptr) {
            home->on_link_sends(who_, line.substr(0, size - 1));
        }
        port_->send(peer_, line);
        at += size;
    }
}

void datagram_link::finish() {
    flush();
    if (const auto home = port_ == nullptr ? nullptr : port_->home_.lock()) {
        home->later({}, [self = shared_from_this()] { self->lose(); });
    }
}

void datagram_link::close() {
    const auto keep = weak_from_this().lock();
    if (const auto port = std::exchange(port_, nullptr)) {
        port->links_.erase(peer_);
        owner_.reset();
        if (port->codec_) {
            port->codec_->release(origin_of(peer_));
        }
    }
}

} // namespace cles::simulation
