// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/datagram_path.hpp"
#include "security/datagrams/noise_kk.hpp"
#include "security/datagrams/replay_window.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

namespace cles::security {

/// What a handshake has agreed on.
struct agreed_session {
    datagram_source peer{};
    node_statement stated{}; ///< by the peer
    bool initiator = false;  ///< whether this end sent HELLO
    std::uint64_t own_index = 0;
    std::uint64_t peer_index = 0;
    time_point begun{};      ///< when HELLO was sent here, or arrived
    std::uint64_t order = 0; ///< of all handshakes of this node, by `begun`
};

/// A session with one peer: seals and opens DATA.
class datagram_session {
  public:
    datagram_session(agreed_session agreed, traffic_keys keys) : agreed_(agreed), keys_(std::move(keys)) {}

    [[nodiscard]] const agreed_session& agreed() const noexcept { return agreed_; }
    /// Whether DATA has arrived: each end then knows that the other one has taken part just now.
    [[nodiscard]] bool confirmed() const noexcept { return confirmed_; }
    /// Datagrams in the direction that has more of them.
    [[nodiscard]] std::uint64_t used() const noexcept { return next_ > window_.highest() ? next_ : window_.highest(); }

    /// \param sender number of this node
    /// \return the part of `to` that is used
    [[nodiscard]] bytes_view seal(std::uint32_t sender, bytes_view line, std::span<std::uint8_t, max_data> to);
    /// Opens a datagram of this session. Its counter is accepted once.
    /// \return the length of the line; nothing if the datagram is refused
    [[nodiscard]] std::optional<std::size_t> open(const datagram_head& head, bytes_view datagram,
                                                  std::span<std::uint8_t, max_line> to);

  private:
    agreed_session agreed_;
    traffic_keys keys_;
    std::uint64_t next_ = 0;
    replay_window window_{};
    bool confirmed_ = false;
};

} // namespace cles::security
