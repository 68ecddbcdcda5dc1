// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge.hpp"
#include "federation/received_message.hpp"
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

    /// Opens a message and passes it to the bridge. If it is refused, or its sender is not proven to be alive, the
    /// bridge is notified of that. This object may be gone afterwards.
    void receive(received_message m, bridge& to);
    /// That bridge is lost. It has to prove again that it is alive.
    void forget(const bridge_id& lost);
    /// A bridge has stated the version of its roster.
    void on_stated_roster(const bridge_id& by, std::uint32_t version, time_point now);

    /// What is to be published as it is, with `questions` as the subject for replies.
    std::vector<core::message_seal::question> take_questions() { return seal_->take_questions(questions_); }
    [[nodiscard]] const std::string& questions() const noexcept { return questions_; }

  private:
    std::unique_ptr<core::message_seal> seal_;
    const std::string questions_; // the own subject for them
};

} // namespace cles::bridging
