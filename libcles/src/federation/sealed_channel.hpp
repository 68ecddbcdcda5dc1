// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/subject.hpp"
#include "port/message_seal.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// Between the bridge of a secured fleet and NATS: seals what is published, opens what is received, and asks senders
/// that are not known whether they are alive (docs/security.md, "Through NATS"). One for each connection. Sans-I/O.
class sealed_channel {
  public:
    sealed_channel(std::unique_ptr<core::message_seal> seal, std::string pool);

    [[nodiscard]] std::uint64_t instance() const { return seal_->instance(); }
    /// Empty if this node is no member.
    [[nodiscard]] std::string seal(std::string_view subject, std::string_view reply, std::string_view message) {
        return seal_->seal(subject, reply, message);
    }

    enum class outcome : std::uint8_t {
        opened,   ///< for the bridge
        consumed, ///< it was for the seal
        refused,
        unproven, ///< nothing has proved yet that the sender is alive
    };
    struct received {
        outcome what = outcome::refused;
        std::string_view sender{};   ///< the member, if it was opened
        std::string instance{};      ///< of the sender, if it was opened
        std::string_view message{};  ///< if it was opened; valid until the next call
        std::string_view why{};      ///< it was refused
        bool heartbeat_soon = false; ///< this bridge or another one has become known, or asks
    };
    received receive(std::string_view where, std::string_view reply, std::string_view bytes, time_point now);
    /// That bridge is lost. It has to prove again that it is alive.
    void forget(const bridge_id& lost);
    /// A bridge has stated the version of its roster.
    void on_stated_roster(const bridge_id& by, std::uint32_t version, time_point now);

    struct outgoing {
        std::string subject;
        std::string reply;
        std::string message;
    };
    /// What is to be published as it is.
    std::vector<outgoing> take_questions();

  private:
    std::unique_ptr<core::message_seal> seal_;
    std::string questions_; // the own subject for them
};

} // namespace cles::bridging
