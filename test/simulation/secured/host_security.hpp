// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/link_admission.hpp"
#include "security/secured_node.hpp"
#include "simulation/network/link_security.hpp"
#include "simulation/network/planted.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

/// The library's security of a node, and what planted faults do to it. Between the node and its sealed group port, it
/// reports what is sent and received.
class host_security final : public simulated_security {
  public:
    host_security(const std::string& directory, planted fault);

    [[nodiscard]] const security::fleet& fleet() const noexcept { return *real_.members(); }

    // node_security
    void begin(std::string_view name, std::uint32_t epoch, const core::clock& time,
               core::security_observer& observer) override;
    void end() override { real_.end(); }
    void on_time(time_point now) override { real_.on_time(now); }
    [[nodiscard]] bool is_member(std::string_view name) const override;
    [[nodiscard]] bool allows(std::string_view requester, std::string_view provider, verb how,
                              const protocol::noun_view& noun) const override;
    [[nodiscard]] bool may_forward(std::string_view forwarder, std::string_view requester) const override {
        return real_.may_forward(forwarder, requester);
    }
    [[nodiscard]] std::string sign_update(std::string_view path, std::uint64_t seq, std::string_view epoch,
                                          std::string_view body) const override {
        return real_.sign_update(path, seq, epoch, body);
    }
    [[nodiscard]] bool is_signed(std::string_view publisher, std::string_view path, std::uint64_t seq,
                                 std::string_view epoch, std::string_view body, std::string_view sig) const override {
        return real_.is_signed(publisher, path, seq, epoch, body, sig);
    }
    [[nodiscard]] std::string new_challenge() const override { return real_.new_challenge(); }
    [[nodiscard]] std::string sign_request(std::string_view node, std::string_view challenge, verb how,
                                           std::string_view path, std::string_view body) const override {
        return real_.sign_request(node, challenge, how, path, body);
    }
    [[nodiscard]] bool is_request_signed(std::string_view requester, std::string_view challenge, verb how,
                                         std::string_view path, std::string_view body,
                                         std::string_view sig) const override {
        return real_.is_request_signed(requester, challenge, how, path, body, sig);
    }
    [[nodiscard]] std::shared_ptr<core::group_port> seal(std::shared_ptr<core::group_port> port) override;
    [[nodiscard]] std::unique_ptr<core::message_seal> seal_messages() override { return real_.seal_messages(); }
    [[nodiscard]] std::uint64_t unsealed_datagrams() const override { return real_.unsealed_datagrams(); }
    [[nodiscard]] std::uint32_t roster_version() const override { return real_.roster_version(); }
    [[nodiscard]] const std::string& roster_line() const override { return real_.roster_line(); }
    std::optional<std::string> offer_roster(std::string_view line) override { return real_.offer_roster(line); }
    bool wants_roster(std::string_view from, std::uint32_t version, time_point now) override {
        return real_.wants_roster(from, version, now);
    }

    [[nodiscard]] protocol_maker maker_of_protocol() const override;

    // link_security
    [[nodiscard]] const link_key& own_key() const override { return fleet().own_key().public_part(); }
    [[nodiscard]] std::unique_ptr<stream_gate> make_gate(std::string_view expected) override;
    [[nodiscard]] std::unique_ptr<transport::datagram_codec> make_codec() override;
    [[nodiscard]] std::uint32_t number_of(std::string_view name) const override;

  private:
    security::secured_node real_;
    planted fault_;
    std::shared_ptr<security::admission_terms> terms_;
};

} // namespace cles::simulation
