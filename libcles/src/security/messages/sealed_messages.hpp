// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/message_seal.hpp"
#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/fork_count.hpp"
#include "security/datagrams/rate_limit.hpp"
#include "security/datagrams/salt_table.hpp"
#include "security/fleet/fleet.hpp"
#include "security/messages/asked_questions.hpp"
#include "security/messages/bridge_sessions.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace cles::security {

/// Seals and opens messages with the keys of a fleet (docs/protocol_security.md, "Through NATS"). Allocates only the
/// message that `seal` returns, and what questions need.
class sealed_messages final : public core::message_seal {
  public:
    /// Takes the line of a roster from another bridge. What is in force may change during the call.
    using roster_sink = std::function<void(std::string_view line)>;

    /// Of questions that nobody fetches, the newest ones are kept.
    static constexpr std::size_t max_questions = 256;

    /// \param of outlives this
    sealed_messages(fleet& of, entropy& random, roster_sink take_roster, std::uint64_t first_counter = 0);

    [[nodiscard]] std::uint64_t instance() const override;
    [[nodiscard]] std::string seal(std::string_view subject, std::string_view reply, std::string_view message) override;
    [[nodiscard]] sealed_message seal_for(std::uint64_t to, std::string_view subject, std::string_view reply,
                                          std::string_view message, time_point now) override;
    [[nodiscard]] opened_message open(std::string_view subject, std::string_view reply, const origin& from,
                                      std::string_view bytes, time_point now) override;
    void forget(std::uint64_t instance) override;
    void on_stated_roster(const origin& by, std::uint32_t version, time_point now) override;
    void on_stated_sessions(const origin& by, time_point now) override;
    [[nodiscard]] std::vector<question> take_questions(std::string_view questions) override;
    [[nodiscard]] bool on_question(std::string_view subject, const origin& from, std::string_view bytes,
                                   time_point now) override;

  private:
    using salt_of_member = std::pair<std::uint32_t, group_salt>;

    // A question or an answer to be sent. It is made when it is fetched.
    struct own_text {
        std::string text;
    };
    struct roster_wanted {};
    struct challenge {
        std::string text;
        std::uint64_t highest = 0; // counter of a message that was found unproven since
    };
    using roster_questions = asked_questions<std::uint64_t, std::monostate>; // about an instance
    struct roster_for {
        std::uint32_t member;
    };
    struct pending {
        std::string subject;
        std::variant<own_text, roster_wanted, roster_for> what;
    };

    [[nodiscard]] bool may_send() const;
    void ask_for_roster(const origin& who, roster_questions& reason, time_point now);
    void write_text(const std::uint8_t* head, std::string_view subject, std::string_view reply,
                    std::string_view message);
    [[nodiscard]] opened_message unseal(std::string_view subject, std::string_view reply, const origin& from,
                                        std::string_view bytes, time_point now);
    [[nodiscard]] opened_message open_in_session(std::string_view subject, std::string_view reply, const origin& from,
                                                 bytes_view sealed, time_point now);
    void tell_unknown_session(const session_head& head, time_point now);
    void send_hello(std::uint64_t to, std::string text);
    void begin_session_again(std::uint64_t with, time_point now);
    void on_session_question(const origin& from, std::uint64_t sender, std::string_view words, time_point now);
    void ask_whether_alive(const origin& who, const salt_of_member& about, time_point now);
    [[nodiscard]] bool on_sealed_question(std::string_view subject, const origin& from, std::string_view bytes,
                                          time_point now);
    void on_ask(const origin& from, bytes_view bytes, time_point now);
    void on_roster(const origin& from, bytes_view bytes, time_point now);
    void keep(std::string_view subject, decltype(pending::what) what);
    [[nodiscard]] std::string write(const pending& what, std::string_view questions);

    fleet& fleet_;
    entropy& random_;
    roster_sink take_roster_;
    std::uint32_t process_ = fork_count();
    group_salt salt_{};
    std::uint64_t counter_;
    salt_table salts_;
    std::string text_;                                           // that is signed
    std::vector<std::uint8_t> opened_;                           // signature and message
    asked_questions<salt_of_member, challenge> challenges_{250}; // as many as heartbeats arrive
    // Those for which a message that could be opened was the reason have a limit of their own: nobody else can use it
    // up.
    roster_questions for_stated_{200};
    roster_questions for_unopened_{50};
    asked_questions<std::uint32_t, std::monostate> roster_answers_{10}; // to a member
    bridge_sessions sessions_;
    asked_questions<std::uint64_t, std::monostate> unknown_sessions_{50}; // that an instance was told of
    rate_limit boxes_{50};
    rate_limit proofs_{1'000};
    std::deque<pending> pending_;
};

} // namespace cles::security
