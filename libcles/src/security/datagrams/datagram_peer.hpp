// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_session.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::security {

class datagram_peer;

/// The sessions that are in use, by their own index.
struct session_in_use {
    datagram_peer* peer;
    datagram_session* session;
};
using session_table = boost::unordered_flat_map<std::uint64_t, session_in_use>;

/// A handshake that this node has begun.
struct hello_attempt {
    noise_initiator handshake;
    std::array<std::uint8_t, hello_with_mac_bytes> hello; // with its MAC
    std::uint64_t index;
    std::uint64_t order;
    time_point begun;
};

/// When something that is not answered is sent again: after 200 ms, then at doubling intervals, three times in all.
class unanswered {
  public:
    void start(time_point now) noexcept {
        sent_ = 1;
        due_ = now + first;
    }
    void stop() noexcept { sent_ = 0; }
    /// When to call `expire`.
    [[nodiscard]] time_point due() const noexcept { return sent_ == 0 ? time_point::max() : due_; }
    /// \pre it is due \return whether to send again; false: give up, and it has stopped
    [[nodiscard]] bool expire(time_point now) noexcept {
        if (sent_ == most) {
            stop();
            return false;
        }
        due_ = now + first * (1 << sent_);
        ++sent_;
        return true;
    }

  private:
    static constexpr int most = 3;
    static constexpr std::chrono::milliseconds first{200};

    int sent_ = 0;
    time_point due_{};
};

/// What a node keeps of one source: the sessions with it, newest first, and the lines that wait for one.
class datagram_peer {
  public:
    /// \param number distinguishes peers \param table lives longer, and lists the sessions
    datagram_peer(datagram_source source, std::uint64_t number, session_table& table);
    datagram_peer(const datagram_peer&) = delete;
    datagram_peer& operator=(const datagram_peer&) = delete;
    ~datagram_peer();

    [[nodiscard]] const datagram_source& source() const noexcept { return source_; }
    [[nodiscard]] std::uint64_t number() const noexcept { return number_; }

    /// Null if there is no session.
    [[nodiscard]] datagram_session* newest() const noexcept;
    /// The session in which this node has sent its first DATA and none has arrived; null if there is none.
    [[nodiscard]] datagram_session* unconfirmed() const noexcept;
    [[nodiscard]] bool is_idle() const noexcept { return sessions_.empty() && trying == nullptr; }

    enum class introduction : std::uint8_t { refused, same_epoch, restarted };
    /// Takes a session into use. If the epoch is another one, the earlier sessions end.
    /// \return refused if its handshake began before that of the newest one, with another epoch: it was delayed, and is
    ///         from a process that has ended
    introduction introduce(std::unique_ptr<datagram_session> made);
    /// Keeps the two newest sessions with DATA.
    void drop_surplus();
    void drop(const datagram_session& session);
    void drop_begun_until(time_point last);
    /// When the oldest session began; none without sessions.
    [[nodiscard]] std::optional<time_point> oldest_begun() const noexcept;

    std::unique_ptr<hello_attempt> trying{};
    unanswered retry{}; ///< of HELLO, or of the first DATA
    std::vector<std::string> waiting{};
    std::size_t waiting_bytes = 0;
    time_point received{};              ///< when DATA or WELCOME arrived last
    time_point last_used{};             ///< in any direction
    time_point due = time_point::max(); ///< the timer of this peer

  private:
    const datagram_source source_;
    const std::uint64_t number_;
    session_table& table_;
    std::vector<std::unique_ptr<datagram_session>> sessions_;
    std::optional<std::uint32_t> epoch_; // stated last
};

} // namespace cles::security
