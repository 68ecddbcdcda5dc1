// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "security/datagrams/sealed_datagrams.hpp"
#include "transport/datagram_codec.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::tls {

/// Seals the datagrams of one UDP socket for the sessions of its node (docs/protocol_security.md, "Between two nodes").
class udp_codec final : public transport::datagram_codec, private security::datagram_socket {
  public:
    /// The fleet is that of the datagrams.
    udp_codec(std::shared_ptr<security::fleet> fleet, std::shared_ptr<security::sealed_datagrams> all)
        : fleet_(std::move(fleet)), all_(std::move(all)) {}
    ~udp_codec() override;

    void start(transport::datagram_codec::carrier& owner) override;
    void stop() override;
    void receive(const endpoint& from, std::string_view datagram) override;
    void send(const transport::datagram_origin& to, std::string_view line) override;
    void contact(const transport::datagram_origin& with) override;
    void check_peer(const transport::datagram_origin& with, time_point since) override;
    void release(const transport::datagram_origin& which) override;
    [[nodiscard]] std::string name_of(std::uint32_t member) const override;

  private:
    // datagram_socket
    void send_sealed(const security::datagram_path& to, security::bytes_view datagram) override;
    void on_opened(const security::datagram_source& from, std::uint32_t epoch, std::string_view line) override;
    void on_established(const security::datagram_source& with, std::uint32_t epoch) override;
    void on_gave_up(const security::datagram_source& with, bool lost) override;
    [[nodiscard]] bool holds(const security::datagram_source& which) const override;

    [[nodiscard]] security::datagram_path path_of(const endpoint& at) const noexcept;
    [[nodiscard]] security::datagram_source source_of(const transport::datagram_origin& o) const noexcept {
        return {.path = path_of(o.at), .member = o.member};
    }
    void on_roster(const security::roster& before);

    std::shared_ptr<security::fleet> fleet_;
    std::shared_ptr<security::sealed_datagrams> all_;
    std::shared_ptr<void> observation_;                   // of the fleet
    transport::datagram_codec::carrier* owner_ = nullptr; // null: stopped
    std::uint32_t number_ = 0;
};

/// `udp://host:port` for one node with security (docs/protocol_security.md, "Datagrams"): each link is to one member,
/// in sessions. A link can only be dialled to a member that is named.
std::unique_ptr<link_transport> make_sealed_udp(std::shared_ptr<security::fleet> fleet,
                                                std::shared_ptr<security::sealed_datagrams> all);

} // namespace cles::tls
