// SPDX-License-Identifier: BSL-1.0
#include "tls/udp_codec.hpp"

#include <boost/asio/ip/address.hpp>

#include <utility>

namespace cles::tls {
namespace asio = boost::asio;
using asio::ip::udp;
using security::datagram_path;
using security::datagram_source;
using transport::datagram_origin;

namespace {

udp::endpoint endpoint_of(const datagram_path& path) {
    if (path.is_v4()) {
        return {asio::ip::address_v4{path.v4_address()}, path.port};
    }
    return {asio::ip::address_v6{path.v6_address(), path.scope}, path.port};
}

datagram_origin origin_of(const datagram_source& source) {
    return {.at = endpoint_of(source.path), .member = source.member};
}

} // namespace

udp_codec::~udp_codec() { udp_codec::stop(); }

void udp_codec::start(transport::datagram_codec::carrier& owner) {
    owner_ = &owner;
    number_ = all_->add(*this);
    observation_ = fleet_->observe([this](const security::roster& before) { on_roster(before); });
}

void udp_codec::stop() {
    if (std::exchange(owner_, nullptr) != nullptr) {
        observation_ = nullptr;
        all_->remove(number_);
    }
}

datagram_path udp_codec::path_of(const endpoint& at) const noexcept {
    const auto address = at.address();
    if (address.is_v4()) {
        return datagram_path::v4(address.to_v4().to_uint(), at.port(), number_);
    }
    const auto v6 = address.to_v6();
    return datagram_path::v6(v6.to_bytes(), at.port(), static_cast<std::uint32_t>(v6.scope_id()), number_);
}

// -- from the socket -----------------------------------------------------------------------------------------------

void udp_codec::receive(const endpoint& from, std::string_view datagram) {
    const security::bytes_view bytes{reinterpret_cast<const std::uint8_t*>(datagram.data()), datagram.size()};
    if (!security::is_sealed(bytes)) {
        all_->count_unsealed();
    } else if (owner_ != nullptr) {
        const auto all = all_; // what the line sets off may end this
        all->receive(path_of(from), bytes);
    }
}

void udp_codec::send(const datagram_origin& to, std::string_view line) {
    static_cast<void>(all_->send(source_of(to), line)); // else it is lost, as datagrams may be
}

void udp_codec::check_peer(const datagram_origin& with, time_point since) { all_->check_peer(source_of(with), since); }

void udp_codec::release(const datagram_origin& which) { all_->release(source_of(which)); }

std::string udp_codec::name_of(std::uint32_t member) const {
    const auto* const found = fleet_->in_force().find(member);
    return found == nullptr ? std::string{} : found->name;
}

// -- from the sessions ---------------------------------------------------------------------------------------------

void udp_codec::send_sealed(const datagram_path& to, security::bytes_view datagram) {
    if (owner_ != nullptr) {
        owner_->transmit(endpoint_of(to), {reinterpret_cast<const char*>(datagram.data()), datagram.size()});
    }
}

void udp_codec::on_opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) {
    if (owner_ != nullptr) {
        owner_->on_opened(origin_of(from), epoch, line);
    }
}

void udp_codec::on_established(const datagram_source& with, std::uint32_t epoch) {
    if (owner_ != nullptr) {
        owner_->on_established(origin_of(with), epoch);
    }
}

void udp_codec::on_gave_up(const datagram_source& with, bool lost) {
    if (owner_ != nullptr) {
        owner_->on_unanswered(origin_of(with), lost);
    }
}

bool udp_codec::holds(const datagram_source& which) const {
    return owner_ != nullptr && owner_->holds(origin_of(which));
}

// If this node is another member now, the others have forgotten what it sent: it must not send that again.
void udp_codec::on_roster(const security::roster& before) {
    const auto* const self = fleet_->self();
    const auto* const self_before = before.find(fleet_->own_key().public_part());
    const bool is_another = self == nullptr || self_before == nullptr || !self->is(*self_before);
    for (const auto& member : before.members()) {
        const auto* const now = fleet_->in_force().find(member.number);
        if (owner_ != nullptr && (is_another || now == nullptr || !now->is(member))) {
            owner_->on_removed(member.number);
        }
    }
}

} // namespace cles::tls
