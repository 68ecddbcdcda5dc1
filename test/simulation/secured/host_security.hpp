// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/link_admission.hpp"
#include "security/secured_node.hpp"
#include "simulation/network/link_security.hpp"
#include "simulation/network/planted.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

/// The library's security of a node, and what planted faults do to it. Between the node and its sealed group port, it
/// reports what is sent and received.
class host_security final : public security::secured_node, public simulated_security {
  public:
    host_security(const std::string& directory, planted fault);

    [[nodiscard]] const security::fleet& fleet() const noexcept { return *members(); }

    // node_security
    void begin(std::string_view name, std::uint32_t epoch, const core::clock& time,
               core::security_observer& observer) override;
    [[nodiscard]] bool is_member(std::string_view name) const override;
    [[nodiscard]] bool allows(const core::request_origin& by, std::string_view provider, verb how,
                              const protocol::noun_view& noun) const override;
    [[nodiscard]] std::shared_ptr<core::group_port> seal(std::shared_ptr<core::group_port> port) override;

    // simulated_security
    [[nodiscard]] core::node_security& of_node() override { return *this; }
    [[nodiscard]] protocol_maker maker_of_protocol() const override;
    [[nodiscard]] const link_key& own_key() const override { return fleet().own_key().public_part(); }
    [[nodiscard]] std::unique_ptr<stream_gate> make_gate(std::string_view expected) override;
    [[nodiscard]] std::unique_ptr<transport::datagram_codec> make_codec() override;
    [[nodiscard]] std::uint32_t number_of(std::string_view name) const override;

  private:
    planted fault_;
    std::shared_ptr<security::admission_terms> terms_;
};

} // namespace cles::simulation
