// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/bridge.hpp"
#include "federation/received_message.hpp"
#include "federation/subject.hpp"
#include "port/message_seal.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// Between the bridge of a secured fleet and NATS: seals what is published, opens what is received, and asks senders
/// that are not known whether they are alive (docs/protocol_security.md, "Through NATS"). What is for one bridge waits
/// until a session with it has begun, if that bridge has sessions. One for each connection. Sans-I/O.
class sealed_channel {
  public:
    /// How long messages wait, and how many bytes of them.
    static constexpr std::chrono::seconds longest_wait{1};
    static constexpr std::size_t most_waiting_for_one = std::size_t{1} << 20U;
    static constexpr std::size_t most_waiting = 4 * most_waiting_for_one;

    sealed_channel(std::unique_ptr<core::message_seal> seal, std::string pool);

    [[nodiscard]] std::uint64_t instance() const { return seal_->instance(); }
    /// What waits is kept here, for `take_ready`. Without bytes, and if it does not wait, the message is lost: this
    /// node is no member, or too much waits already.
    [[nodiscard]] core::message_seal::sealed_message seal(std::string_view subject, std::string_view reply,
                                                          std::string_view message, time_point now);

    /// Opens a message and passes it to the bridge. If it is refused, or its sender is not proven to be alive, the
    /// bridge is notified of that. This object may be gone afterwards.
    void receive(received_message m, bridge& to);
    /// That bridge is lost. It has to prove again that it is alive.
    void forget(const bridge_id& lost);
    /// A bridge has stated the version of its roster.
    void on_stated_roster(const bridge_id& by, std::uint32_t version, time_point now);
    /// A bridge has stated that it has sessions.
    void on_stated_sessions(const bridge_id& by, time_point now);

    /// What is to be published as it is, with `questions` as the subject for replies.
    std::vector<core::message_seal::question> take_questions() { return seal_->take_questions(questions_); }
    [[nodiscard]] const std::string& questions() const noexcept { return questions_; }

    /// A message, and its subjects.
    struct outgoing {
        std::string subject;
        std::string reply;
        std::string message;
    };
    /// What need not wait any more, sealed, in the order in which it was passed to `seal`. To be called after
    /// `receive`.
    [[nodiscard]] std::vector<outgoing> take_ready(time_point now);
    /// Whether a message still waits. None does after `longest_wait`.
    [[nodiscard]] bool has_waiting(time_point now);

  private:
    struct waiting_message {
        outgoing what;
        time_point until;
    };
    struct waiting_messages {
        std::deque<waiting_message> queue;
        std::size_t bytes = 0;
    };

    [[nodiscard]] bool keep_waiting(std::uint64_t to, outgoing what, time_point now);
    void drop_first(waiting_messages& of);
    void drop_late(waiting_messages& of, time_point now);

    std::unique_ptr<core::message_seal> seal_;
    const std::string questions_;                       // the own subject for them
    std::map<std::uint64_t, waiting_messages> waiting_; // by the instance that they are for
    std::size_t waiting_bytes_ = 0;
};

} // namespace cles::bridging
