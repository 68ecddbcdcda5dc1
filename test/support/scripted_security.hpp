// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/node_security.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace cles::test {

/// A fleet whose rights the test sets: everything is permitted except what is in `denied`.
class scripted_security final : public core::node_security {
  public:
    [[nodiscard]] bool is_member(std::string_view name) const override { return members.contains(std::string{name}); }
    [[nodiscard]] bool allows(const core::request_origin& by, std::string_view provider, verb how,
                              const protocol::noun_view& noun) const override {
        if (by.requester == self && by.forwarder.empty() && provider == self) {
            return true;
        }
        return is_member(by.requester) && !refuses_all_at.contains(std::string{provider}) &&
               (by.forwarder.empty() || may_forward(by.forwarder, by.requester)) &&
               !denied.contains(std::string{by.requester} + " " + std::string{to_string(how)} + " " +
                                std::string{provider} + ":" + std::string{noun.path});
    }
    [[nodiscard]] bool may_forward(std::string_view forwarder, std::string_view requester) const override {
        return is_member(forwarder) && is_member(requester) &&
               (forwarder == requester || forwarders.contains(std::string{forwarder}));
    }
    [[nodiscard]] std::string sign_update(std::string_view path, std::uint64_t seq, std::string_view epoch,
                                          std::string_view body) const override {
        return signature(self, path, seq, epoch, body);
    }
    [[nodiscard]] bool is_signed(std::string_view publisher, std::string_view path, std::uint64_t seq,
                                 std::string_view epoch, std::string_view body, std::string_view sig) const override {
        return sig == signature(publisher, path, seq, epoch, body);
    }
    [[nodiscard]] std::string new_challenge() const override {
        return challenge.empty() ? "challenge" + std::to_string(++challenges) : challenge;
    }
    [[nodiscard]] std::string sign_request(std::string_view node, std::string_view challenge, verb how,
                                           std::string_view path, std::string_view body,
                                           std::uint32_t waits_ms) const override {
        return challenge.starts_with("challenge") ? request_signature(self, node, challenge, how, path, body, waits_ms)
                                                  : std::string{};
    }
    [[nodiscard]] bool is_request_signed(std::string_view requester, std::string_view challenge, verb how,
                                         std::string_view path, std::string_view body,
                                         const protocol::request_signature& sig) const override {
        return sig.signature == request_signature(requester, self, challenge, how, path, body, sig.waits_ms);
    }
    static std::string request_signature(std::string_view requester, std::string_view node, std::string_view challenge,
                                         verb how, std::string_view path, std::string_view body,
                                         std::uint32_t waits_ms) {
        std::string all;
        for (const auto part : {requester, node, challenge, to_string(how), path, body}) {
            all.append(part).push_back('-');
        }
        return std::to_string(std::hash<std::string>{}(all + std::to_string(waits_ms)));
    }
    [[nodiscard]] std::shared_ptr<core::group_port> seal(std::shared_ptr<core::group_port> port) override {
        return port;
    }
    [[nodiscard]] std::unique_ptr<core::message_seal> seal_messages() override { return {}; }
    static std::string signature(std::string_view publisher, std::string_view path, std::uint64_t seq,
                                 std::string_view epoch, std::string_view body) {
        std::string all;
        for (const auto part : {publisher, path, epoch, body}) {
            all.append(part).push_back('-');
        }
        return std::to_string(std::hash<std::string>{}(all + std::to_string(seq)));
    }
    [[nodiscard]] std::uint32_t roster_version() const override { return version; }
    [[nodiscard]] const std::string& roster_line() const override { return line; }
    std::optional<std::string> offer_roster(std::string_view offered) override {
        if (offered != "{\"good\":1}") {
            return "a bad roster";
        }
        line = offered;
        change();
        return {};
    }
    bool wants_roster(std::string_view from, std::uint32_t stated, time_point) override {
        return is_member(from) && stated > version;
    }
    void begin(std::string_view, std::uint32_t, const core::clock&, core::security_observer& by) override {
        observer_ = &by;
    }
    void end() override { observer_ = nullptr; }
    void on_time(time_point) override {}

    /// The roster or the rules change.
    void change() {
        if (observer_ != nullptr) {
            observer_->on_security_changed();
        }
    }

    std::set<std::string> members{"car1", "car2", "car3", "sat1"};
    std::set<std::string> denied;             ///< "car2 PULL car1:speed"
    std::set<std::string> refuses_all_at{};   ///< nodes of which others may request nothing
    std::set<std::string> forwarders{"car1"}; ///< for everybody
    std::string self = "car1";                ///< whose security this is
    mutable int challenges = 0;               ///< that were drawn
    std::string challenge{};                  ///< if it is set, the one that is always drawn
    std::uint32_t version = 7;
    std::string line = "{\"signature\":\"s\",\"roster\":{}}";

  private:
    core::security_observer* observer_ = nullptr;
};

} // namespace cles::test
