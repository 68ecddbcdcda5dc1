// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "peer.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/baseline/update_packet.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

/// The two calls as packets of the hand-written exchange, for peers that carry bytes and have no encoding:
///
/// | bytes | task's request  | task's reply    |
/// | ----- | --------------- | --------------- |
/// | 2     | message type, 4 | message type, 5 |
/// | 2     | total length, 4 | total length, 4 |
namespace cles::perf::peers {

inline constexpr std::uint16_t task_type = 4;
inline constexpr std::uint16_t done_type = 5;

icd::request_bytes request_of(call what) noexcept;

/// The server's side.
class answering {
  public:
    /// The answer, valid until the next call. \throws std::runtime_error if this is not a request
    std::span<const std::byte> answer(std::span<const std::byte> request);

  private:
    std::uint64_t served_ = 0;
    icd::reply_bytes localization_{};
    icd::request_bytes done_{};
};

/// The caller's side. \throws std::runtime_error if this is not an answer to that call, or its values are not those
/// that were sent
void check_answer(call what, std::span<const std::byte> answer);

/// \throws std::runtime_error if this is not an update
publication read_update(std::span<const std::byte> packet);

} // namespace cles::perf::peers
