// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "security/datagrams/entropy.hpp"
#include "security/datagrams/handshake_turns.hpp"
#include "security/datagrams/noise_kk.hpp"
#include "security/datagrams/replay_window.hpp"
#include "security/fleet/fleet.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// The readable part of a message that is sealed under a session.
struct session_head {
    std::uint64_t instance = 0; ///< of the sender
    std::uint64_t index = 0;    ///< of the session, drawn by the receiver
    std::uint64_t counter = 0;
};

/// The sessions of a bridge with others (docs/protocol_security.md, "Through NATS"). Each carries messages in one
/// direction: a bridge sends in the session that it has begun. So both ends may begin one at any time, and neither has
/// to know which of several the other one uses.
///
/// HELLO and WELCOME travel in signed messages, which count once, and only if their sender is proved to be alive:
/// nobody else can make one, and copies have no effect. Bridges are known by their instance, whose first 24 bits are
/// the number of the member. Sans-I/O.
class bridge_sessions final {
  public:
    static constexpr std::uint8_t message_kind = 0x88; ///< the first byte
    static constexpr std::size_t head_bytes = 25;
    static constexpr std::size_t overhead = head_bytes + 16; ///< by which a sealed message is longer

    static constexpr std::chrono::minutes rekey_after{15};
    static constexpr std::chrono::minutes forget_after{20};
    static constexpr std::uint64_t rekey_messages = std::uint64_t{1} << 48U;
    static constexpr std::chrono::milliseconds between_hellos{200}; ///< to one bridge
    static constexpr std::chrono::seconds answered_within{10};      ///< HELLO; then another one is made

    static constexpr std::size_t most_of_member = 8; ///< bridges; those that were heard last are known
    static constexpr std::size_t most_received = 3;  ///< sessions that one bridge has begun; the newest ones count
    static constexpr member_turns::bounds hello_turns = member_bounds(250, {.per_second = 8, .at_once = 8});

    /// \param of outlives this
    bridge_sessions(fleet& of, entropy& random);
    bridge_sessions(const bridge_sessions&) = delete;
    bridge_sessions& operator=(const bridge_sessions&) = delete;

    /// That bridge has sessions, and does until its connection ends. \param questions its subject for questions, which
    /// is not empty
    void note_able(std::uint64_t peer, std::string_view questions, time_point now);
    [[nodiscard]] bool is_able(std::uint64_t peer) const { return peers_.contains(peer); }
    /// Its subject for questions; empty if it is not known to have sessions.
    [[nodiscard]] std::string_view questions_of(std::uint64_t peer) const;
    /// Nothing counts any more that was sealed under a session with that bridge. It still has sessions.
    void end_sessions(std::uint64_t peer);

    /// HELLO, if it is to be sent to that bridge now, because there is no session to send in, or an old one; else
    /// empty. \param own the instance of this bridge
    [[nodiscard]] std::string hello_if_due(std::uint64_t own, std::uint64_t peer, time_point now);
    /// The other end has lost what it had of the sessions with this one, or has sent what did not count here yet:
    /// HELLO, whenever the last one was sent.
    [[nodiscard]] std::string begin_again(std::uint64_t own, std::uint64_t peer, time_point now);
    /// The other end does not know the session of that index. Ignored if it is not the one in use.
    void end_unknown(std::uint64_t peer, std::uint64_t index);
    /// Takes HELLO. Returns WELCOME; empty: none.
    [[nodiscard]] std::string take_hello(std::uint64_t own, std::uint64_t peer, std::string_view hello, time_point now);
    void take_welcome(std::uint64_t peer, std::string_view welcome);

    /// Empty if there is no session to send in.
    [[nodiscard]] std::string seal(std::uint64_t own, std::uint64_t peer, std::string_view subject,
                                   std::string_view reply, std::string_view message, time_point now);

    /// Nothing if it is not sealed under a session.
    [[nodiscard]] static std::optional<session_head> read_head(bytes_view sealed) noexcept;
    enum class verdict : std::uint8_t {
        unknown, ///< there is no such session, or it is too old
        refused, ///< altered, repeated, or too late
        opened,
    };
    /// \param to receives the message, if it is opened
    [[nodiscard]] verdict open(const session_head& head, std::string_view subject, std::string_view reply,
                               bytes_view sealed, std::vector<std::uint8_t>& to, time_point now);

  private:
    struct attempt {
        noise_initiator handshake;
        std::uint64_t index;
        std::string hello;
        time_point begun;
    };
    struct sending_session {
        traffic_keys keys{};
        std::uint64_t index = 0;
        std::uint64_t next = 0; // counter
        time_point begun{};     // when HELLO was made
    };
    struct receiving_session {
        traffic_keys keys{};
        std::uint64_t index = 0;
        replay_window window{};
        time_point begun{}; // when HELLO arrived
        std::string hello{};
        std::string welcome{};
    };
    struct peer_state {
        std::string questions{};
        std::uint64_t order = 0; // in which peers were heard last
        std::optional<time_point> hello_sent{};
        std::unique_ptr<attempt> trying{};
        std::optional<sending_session> sending{};
        std::vector<receiving_session> receiving{}; // the newest is first
    };
    using peers = std::map<std::uint64_t, peer_state>; // by instance, so those of a member are in a row

    void on_roster(const roster& before);
    [[nodiscard]] peer_state* find(std::uint64_t peer);
    void make_space(std::uint32_t member);
    void erase_all_of(std::uint32_t member);
    [[nodiscard]] std::unique_ptr<attempt> begin(std::uint64_t own, std::uint64_t peer, time_point now);
    [[nodiscard]] bytes_view additional_data(bytes_view head, std::string_view subject, std::string_view reply);

    fleet& fleet_;
    entropy& random_;
    std::shared_ptr<void> observation_;
    member_turns turns_{hello_turns};
    peers peers_;
    std::uint64_t order_ = 0;
    std::string additional_;
};

} // namespace cles::security
