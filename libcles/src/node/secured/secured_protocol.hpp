// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/secured/confirmed_epochs.hpp"
#include "node/secured/local_security.hpp"
#include "node/secured/request_challenges.hpp"
#include "node/secured/request_signer.hpp"
#include "node/secured/signed_announcer.hpp"
#include "node/security_protocol.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

namespace cles::core {

/// What a secured node says besides the plain protocol, as far as the node's security (`node_security`) permits it.
class secured_protocol final : public security_protocol {
  public:
    /// \pre the node has its security, and outlives this
    explicit secured_protocol(node_state& host);

    void start(local_node& host) override;
    void stop() noexcept override;
    std::unique_ptr<link_security> on_link(const std::shared_ptr<node_state>& host, line_sink& out, outbound& asking,
                                           const identity& peer,
                                           std::function<void(std::string_view line)> deliver) override;
    void on_unanswered(std::string_view peer) override;
    detail::pending_ptr watch(const outgoing_call& request, detail::pending_ptr operation) override;
    bool cancel(std::uint64_t ticket) override;
    std::optional<protocol::failure> refusal(const identity& link, const protocol::request_line& request,
                                             time_point& due, time_point now) override;
    void forget(const identity& link) noexcept override { challenges_.forget(link); }
    bool serve_reserved(reply_writer& replies, const protocol::request_line& request) override;
    std::optional<bool> must_be_signed(std::string_view publisher, std::string_view task) const override;
    update_check check(const protocol::request_line& update, bool direct) const override;
    std::string announce(announcement& said, std::uint64_t& seq, bool in_group, bool by_gossip) override;
    void on_solicited() override { announcer_.sign_next(); }
    bool on_load_report(const group_source& from, const protocol::request_line& report, time_point now) override;
    std::vector<std::string> endpoints(const std::vector<group_port*>& in_group, bool all) override;
    void on_stated_roster(std::string_view node, std::uint32_t version, time_point now) override;

    [[nodiscard]] confirmed_epochs& confirmed() noexcept { return confirmed_; }
    [[nodiscard]] const request_challenges& challenges() const noexcept { return challenges_; }

  private:
    /// \param epoch of the update; nothing: any, since it is not known
    [[nodiscard]] std::optional<bool> must_be_signed(std::string_view publisher, std::string_view task,
                                                     std::optional<std::uint32_t> epoch) const;

    node_state& node_;
    confirmed_epochs confirmed_;
    request_challenges challenges_;
    signed_announcer announcer_;
    local_node* host_ = nullptr;             // null: it does not run
    std::optional<local_security> security_; // while it runs
    std::shared_ptr<request_signer> signer_; // likewise
};

/// For `node_options::secured`.
std::unique_ptr<security_protocol> make_secured_protocol(node_state& host);

} // namespace cles::core
