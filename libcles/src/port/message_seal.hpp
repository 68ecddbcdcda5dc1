// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/environment.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Seals the messages of a bridge on their way through NATS, and opens those of other bridges
/// (docs/protocol_security.md, "Through NATS"). One for each connection to NATS: each has a salt of its own. Sans-I/O.
class message_seal {
  public:
    message_seal() = default;
    message_seal(const message_seal&) = delete;
    message_seal& operator=(const message_seal&) = delete;
    virtual ~message_seal() = default;

    /// By so many bytes a sealed message is longer.
    static constexpr std::size_t overhead = 32 + 64 + 16;

    /// The instance of this bridge: 24 bits of its number as a member, 40 random ones. 0 if it is no member. It changes
    /// if a newer roster gives this node another number; then the connection is to be made anew.
    [[nodiscard]] virtual std::uint64_t instance() const = 0;

    /// A message for that subject, with that subject for replies. Empty if this node is no member, in a child process,
    /// and when the last counter has been used: then the connection is to be made anew.
    [[nodiscard]] virtual std::string seal(std::string_view subject, std::string_view reply,
                                           std::string_view message) = 0;

    struct sealed_message {
        std::string bytes{};     ///< empty: it waits, or cannot be sealed, as of `seal`
        bool in_session = false; ///< else it is signed
        bool waits = false;      ///< for the session, which begins: try again after questions were received
    };
    /// A message for one bridge. If that one has sessions, it is sealed under the session with it, and never in another
    /// way.
    [[nodiscard]] virtual sealed_message seal_for(std::uint64_t to, std::string_view subject, std::string_view reply,
                                                  std::string_view message, time_point now) = 0;

    enum class verdict : std::uint8_t {
        refused,  ///< not sealed, altered, repeated, of a generation that is not accepted, or not of a member
        unproven, ///< authentic, but perhaps an old one: its sender is asked whether it is alive. It never counts
        opened,
    };
    struct opened_message {
        verdict what = verdict::refused;
        std::string_view sender{};  ///< the member's name, unless it was refused; valid while the roster is in force
        std::uint64_t instance = 0; ///< of the sender, unless it was refused
        std::string_view message{}; ///< unless it was refused; valid until the next one is opened
        std::string_view why{};     ///< why it was refused, for people
    };
    /// The bridge that sent a message, as far as the message states it in its subjects.
    struct origin {
        std::optional<std::uint64_t> instance{}; ///< nothing: not stated
        std::string_view questions{};            ///< its subject for questions; empty: not stated
        bool is_update = false;                  ///< updates and other messages may overtake each other, by any number
        bool is_for_one = false; ///< a request, reply or control line: of a bridge that has sessions, it
                                 ///< counts under a session only. No other message counts under one
    };
    /// What was received on that subject. It is refused if it is not of the instance that is stated.
    [[nodiscard]] virtual opened_message open(std::string_view subject, std::string_view reply, const origin& from,
                                              std::string_view bytes, time_point now) = 0;
    /// That bridge is lost: its messages do not count until it has proved again that it is alive, and sessions with it
    /// end.
    virtual void forget(std::uint64_t instance) = 0;
    /// A bridge has stated this version of its roster, in a message that was opened.
    virtual void on_stated_roster(const origin& by, std::uint32_t version, time_point now) = 0;
    /// A bridge has stated that it has sessions, in a message that was opened. That holds until its connection ends.
    virtual void on_stated_sessions(const origin& by, time_point now) = 0;

    /// A message of the bridges' seals to each other: whether a sender is alive, sessions, and the roster.
    struct question {
        std::string subject;
        std::string message;
    };
    /// What is to be sent now, with this bridge's subject for questions as the subject for replies.
    [[nodiscard]] virtual std::vector<question> take_questions(std::string_view questions) = 0;
    /// What was received on this bridge's subject for questions; the subject for replies was `from.questions`. A newer
    /// roster may come into force during the call.
    /// Returns true if the other end did not know this bridge, or this bridge has come to know it: it needs a heartbeat
    /// soon.
    [[nodiscard]] virtual bool on_question(std::string_view subject, const origin& from, std::string_view bytes,
                                           time_point now) = 0;
};

} // namespace cles::core
