// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_peer.hpp"
#include "security/datagrams/fork_count.hpp"
#include "security/datagrams/half_open_sessions.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::security {

struct datagram_limits {
    std::uint32_t hellos_per_second = 500; ///< new ones of members that are opened, and as many WELCOME
    std::chrono::nanoseconds rekey_after = std::chrono::minutes{15};
    std::chrono::nanoseconds forget_after = std::chrono::minutes{20};
    std::uint64_t rekey_datagrams = std::uint64_t{1} << 48U;
    std::size_t sources_per_member = 64;
    std::size_t waiting_lines = 16; ///< for a session with one source
    std::size_t waiting_bytes = 16384;
    std::size_t waiting_bytes_in_all = std::size_t{1} << 20U;
};

/// What `datagram_sessions` reports and requires. Everything is valid during the call.
///
/// `established`, `opened` and `gave_up` are called when all else is done, so they may call any function of
/// `datagram_sessions` except `receive` and `on_time`, and may throw. The others may do neither.
class datagram_sink {
  public:
    datagram_sink() = default;
    datagram_sink(const datagram_sink&) = delete;
    datagram_sink& operator=(const datagram_sink&) = delete;

    /// Sends a datagram. It may be lost.
    virtual void send(const datagram_path& to, bytes_view datagram) = 0;
    /// What this node states of itself now.
    [[nodiscard]] virtual node_statement statement() = 0;
    /// A new session is in use. What the peer has stated is true now: it is the end of an exchange with it.
    /// \param restarted an earlier session stated another epoch: what was sent in it may not have been received
    virtual void established(const datagram_source& with, const node_statement& stated, bool restarted) = 0;
    /// A line has arrived, once. Its session has been reported, with the same epoch.
    virtual void opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) = 0;
    /// A handshake was not answered, and lines that waited for it are dropped: try `tls`, which also exchanges rosters.
    /// \param lost there is no earlier session either
    virtual void gave_up(const datagram_source& with, bool lost) = 0;
    /// A HELLO was not opened. Anybody can send one in the name of any member.
    virtual void refused(const datagram_source&, hello_refusal) {}
    /// Whether to remember the epoch of a source without a session, so that a restart is reported: requests may have
    /// been sent to it, and may be sent again. What is asked for is to be released.
    [[nodiscard]] virtual bool holds(const datagram_source&) const { return false; }

  protected:
    ~datagram_sink() = default;
};

/// The sessions of one node with others, over datagrams between two addresses (docs/protocol_security.md, "Between two
/// nodes").
///
/// Sans-I/O. The owner passes in what arrives, calls `on_time` at `next_deadline`, and sends what it is given. While a
/// session is in use, `send` and `receive` allocate nothing. When the roster in force changes, the sessions with
/// members that are no longer in it end. In a child process, all sessions have ended.
///
/// After 15 minutes, a session is renewed only when it is used; otherwise it is forgotten, and the next line begins a
/// new one.
class datagram_sessions {
  public:
    datagram_sessions(fleet& of, datagram_sink& sink, entropy& random, datagram_limits limits = {});
    datagram_sessions(const datagram_sessions&) = delete;
    datagram_sessions& operator=(const datagram_sessions&) = delete;
    ~datagram_sessions();

    /// Takes a datagram that is HELLO, WELCOME or DATA; ignores others.
    void receive(const datagram_path& from, bytes_view datagram, time_point now);
    /// Sends a line in the newest session with the peer. If there is none, the line waits for one, which begins. If the
    /// peer turns out to have restarted, lines that wait are dropped: they may be copies of what it has received
    /// before. \return false: the line is dropped, because it is too long, too much is waiting, or there is no such
    /// member
    bool send(const datagram_source& to, std::string_view line, time_point now);
    /// Begins a new session, also if there is one, unless one is beginning. \return false: there is no such member
    bool contact(const datagram_source& with, time_point now);
    /// For a request that is sent again: if nothing has arrived from the peer since, begins a new session, because the
    /// peer may have restarted. \param since when the request was sent last
    void check_peer(const datagram_source& with, time_point since, time_point now);
    /// The sink no longer holds a source.
    void release(const datagram_source& which);
    /// Ends all sessions with a member.
    void forget(std::uint32_t member);

    [[nodiscard]] std::optional<time_point> next_deadline() const;
    void on_time(time_point now);

    /// Sources with a session or a handshake that this node has begun.
    [[nodiscard]] std::size_t sources() const noexcept { return peers_.size(); }
    /// Sessions that wait for their first DATA.
    [[nodiscard]] std::size_t half_open() const noexcept { return half_open_.size(); }
    /// Bytes of lines that wait for a session.
    [[nodiscard]] std::size_t waiting() const noexcept { return waiting_bytes_; }

  private:
    using peer = datagram_peer;

    void receive_hello(const datagram_path& from, const datagram_head& head, bytes_view datagram, time_point now);
    void receive_welcome(const datagram_path& from, const datagram_head& head, bytes_view datagram, time_point now);
    void receive_data(const datagram_path& from, const datagram_head& head, bytes_view datagram, time_point now);

    [[nodiscard]] peer* find(const datagram_source& source);
    [[nodiscard]] peer* find_or_make(const datagram_source& source, time_point now);
    [[nodiscard]] bool make_space(std::uint32_t member);
    void erase(peer& p);

    bool begin(peer& p, time_point now);
    void send_again(const peer& p);
    void end_attempt(peer& p);
    bool keep_waiting(peer& p, std::string_view line);
    void drop_waiting(peer& p);
    void send_in(peer& p, datagram_session& session, std::string_view line, time_point now);
    bool send_waiting(peer& p, time_point now);
    void rekey_if_old(peer& p, const datagram_session& session, time_point now);

    void arm(peer& p);
    void serve(peer& p, time_point now);
    void on_roster(const roster& before);
    void clear();
    [[nodiscard]] std::uint64_t new_index();

    fleet& fleet_;
    datagram_sink& sink_;
    entropy& random_;
    const datagram_limits limits_;
    std::shared_ptr<void> observation_;
    fork_detector process_;
    std::uint64_t order_ = 0;
    member_turns welcomes_; // anybody who sees a HELLO can forge its answer
    half_open_sessions half_open_;
    session_table sessions_;
    boost::unordered_flat_map<datagram_source, std::unique_ptr<peer>, datagram_source::hash> peers_;
    boost::unordered_flat_map<std::uint32_t, std::vector<peer*>> members_;
    boost::unordered_flat_map<std::uint64_t, peer*> attempts_; // by own index
    std::map<std::pair<time_point, std::uint64_t>, peer*> timers_;
    std::size_t waiting_bytes_ = 0;
    peer* recent_ = nullptr; // of the line that was sent last
    std::array<std::uint8_t, max_data> sealed_{};
    std::array<std::uint8_t, max_line> opened_{};
};

} // namespace cles::security
