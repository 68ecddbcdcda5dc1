// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/log_budget.hpp"
#include "port/node_security.hpp"
#include "security/access/access_policy.hpp"
#include "security/datagrams/sealed_datagrams.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet/key_directory.hpp"
#include "security/refused_link.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// The security of a node, from its directory: its key, the roster in force, the local rules, and what it seals. It
/// stores newer rosters there, and notices when somebody else changes the rules or adds a roster.
class secured_node : public core::node_security {
  public:
    /// How often the files are looked at.
    static constexpr std::chrono::seconds check_interval{1};
    /// How long a member that did not deliver its roster is not asked again: at first, and at most.
    static constexpr std::chrono::seconds ask_again_after{1};
    static constexpr std::chrono::minutes longest_pause{1};

    /// \throws security_error
    explicit secured_node(const std::string& directory);
    ~secured_node() override;

    [[nodiscard]] const std::string& name() const noexcept { return fleet_->name(); }
    [[nodiscard]] const std::shared_ptr<security::fleet>& members() const noexcept { return fleet_; }
    [[nodiscard]] const std::shared_ptr<sealed_datagrams>& datagrams() const noexcept { return datagrams_; }
    /// Writes to the node's log.
    void log(log_level level, std::string text) const;
    /// Warns of a link that was not opened, and why: a few times a minute for each kind and source.
    void log_refused_link(const refused_link& link);

    // node_security
    void begin(std::string_view name, std::uint32_t epoch, const core::clock& time,
               core::security_observer& observer) override;
    void end() override;
    void on_time(time_point now) override;
    [[nodiscard]] bool is_member(std::string_view name) const override;
    [[nodiscard]] bool allows(const core::request_origin& by, std::string_view provider, verb how,
                              const protocol::noun_view& noun) const override;
    [[nodiscard]] bool may_forward(std::string_view forwarder, std::string_view requester) const override;
    [[nodiscard]] std::string sign_update(std::string_view path, std::uint64_t seq, std::string_view epoch,
                                          std::string_view body) const override;
    [[nodiscard]] bool is_signed(std::string_view publisher, std::string_view path, std::uint64_t seq,
                                 std::string_view epoch, std::string_view body, std::string_view sig) const override;
    [[nodiscard]] std::string new_challenge() const override;
    [[nodiscard]] std::string sign_request(std::string_view node, std::string_view challenge, verb how,
                                           std::string_view path, std::string_view body,
                                           std::uint32_t waits_ms) const override;
    [[nodiscard]] bool is_request_signed(std::string_view requester, std::string_view challenge, verb how,
                                         std::string_view path, std::string_view body,
                                         const protocol::request_signature& sig) const override;
    [[nodiscard]] std::shared_ptr<core::group_port> seal(std::shared_ptr<core::group_port> port) override;
    [[nodiscard]] std::unique_ptr<core::message_seal> seal_messages() override;
    [[nodiscard]] std::uint64_t unsealed_datagrams() const override { return datagrams_->unsealed(); }
    [[nodiscard]] std::uint64_t unopened_group_datagrams() const override { return datagrams_->group_unopened(); }
    [[nodiscard]] std::uint32_t roster_version() const override { return fleet_->in_force().version(); }
    [[nodiscard]] const std::string& roster_line() const override { return fleet_->in_force().line(); }
    std::optional<std::string> offer_roster(std::string_view line) override;
    bool wants_roster(std::string_view from, std::uint32_t version, time_point now) override;

  private:
    struct asked_member {
        std::uint32_t version = 0;
        time_point at{};
        std::chrono::seconds pause{};
    };

    void log_refusal(std::string_view kind, std::string_view source, std::string_view why, std::string text);
    void log_refused_hello(const datagram_source& by, hello_refusal why);
    void on_roster();
    void adopt_changes();
    void store();
    void check_files();
    /// Enough to see whether files are to be read: which there are, and when they were changed.
    struct directory_state {
        std::string roster;
        std::string others;

        bool operator==(const directory_state&) const = default;
    };
    [[nodiscard]] std::string roster_state() const;
    [[nodiscard]] directory_state file_state() const;
    void report_unanswered(std::uint32_t member, const std::vector<std::string>& endpoints) const;

    key_directory directory_;
    std::vector<std::string> warnings_; // of the start
    std::shared_ptr<security::fleet> fleet_;
    local_rules rules_;
    std::unique_ptr<access_policy> policy_;
    mutable decoded_noun noun_; // scratch space
    std::shared_ptr<sealed_datagrams> datagrams_;
    core::security_observer* observer_ = nullptr;
    const core::clock* time_ = nullptr; // since `begin`
    core::log_budget refusals_;
    std::shared_ptr<void> observation_; // of the fleet
    std::map<std::string, asked_member, std::less<>> asked_;
    directory_state files_; // at the last check
    time_point next_check_{};
    time_point next_datagrams_{time_point::max()};
};

} // namespace cles::security
