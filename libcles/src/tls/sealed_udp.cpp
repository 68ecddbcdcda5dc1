// SPDX-License-Identifier: BSL-1.0
#include "tls/sealed_udp.hpp"

#include "tls/tls_error.hpp"
#include "transport/ip_host.hpp"
#include "transport/udp.hpp"

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
    const auto bytes = security::as_bytes(datagram);
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

void udp_codec::contact(const datagram_origin& with) {
    static_cast<void>(all_->contact(source_of(with))); // without such a member, there is no answer
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
        owner_->transmit(endpoint_of(to), security::as_text(datagram));
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
    const bool is_same = fleet_->is_same_since(before);
    for (const auto& member : before.members()) {
        if (owner_ != nullptr && !(is_same && fleet_->in_force().has(member))) {
            owner_->on_removed(member.number);
        }
    }
}

// -- the transport -------------------------------------------------------------------------------------------------

namespace {

class sealed_udp final : public link_transport {
  public:
    sealed_udp(std::shared_ptr<security::fleet> fleet, std::shared_ptr<security::sealed_datagrams> all)
        : fleet_(std::move(fleet)), all_(std::move(all)) {}

    [[nodiscard]] bool authenticates() const override { return true; }
    [[nodiscard]] bool is_exposed(const url& where) const override { return transport::is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        return transport::listen_udp(executor, where, std::make_unique<udp_codec>(fleet_, all_));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_node(executor, where, {}, bounds, std::move(done));
    }

    std::function<void()> dial_node(const asio::any_io_executor& executor, const url& where, std::string_view name,
                                    const limits& bounds, dial_callback done) override {
        return transport::dial_udp(
            executor, where, bounds, std::move(done),
            [fleet = fleet_, all = all_, expected = std::string{name}](boost::system::error_code& code) {
                return member_of(fleet, all, expected, code);
            });
    }

  private:
    static transport::sealed_peer member_of(const std::shared_ptr<security::fleet>& fleet,
                                            const std::shared_ptr<security::sealed_datagrams>& all,
                                            const std::string& name, boost::system::error_code& code) {
        const auto* const found = fleet->in_force().find(name);
        if (found == nullptr) {
            code = name.empty() ? tls_errc::needs_name : tls_errc::unknown_name;
            return {};
        }
        return {.codec = std::make_unique<udp_codec>(fleet, all), .member = found->number, .name = name};
    }

    std::shared_ptr<security::fleet> fleet_;
    std::shared_ptr<security::sealed_datagrams> all_;
};

} // namespace

std::unique_ptr<link_transport> make_sealed_udp(std::shared_ptr<security::fleet> fleet,
                                                std::shared_ptr<security::sealed_datagrams> all) {
    return std::make_unique<sealed_udp>(std::move(fleet), std::move(all));
}

} // namespace cles::tls
