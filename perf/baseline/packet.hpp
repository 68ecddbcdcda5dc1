// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/localization.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include <endian.h>

/// The packets of a fictitious interface control document, in network order, as they are written by hand:
///
/// | bytes | request         | reply                                         |
/// | ----- | --------------- | --------------------------------------------- |
/// | 2     | message type, 1 | message type, 2                               |
/// | 2     | total length, 4 | total length, 44                              |
/// | 5 x 8 |                 | utc, lat, lon, velocity, acceleration (IEEE)  |
namespace cles::perf::icd {

inline constexpr std::uint16_t request_type = 1;
inline constexpr std::uint16_t reply_type = 2;

struct [[gnu::packed]] request_packet {
    std::uint16_t type;
    std::uint16_t length;
};
struct [[gnu::packed]] reply_packet {
    std::uint16_t type;
    std::uint16_t length;
    std::uint64_t values[5];
};
static_assert(sizeof(request_packet) == 4);
static_assert(sizeof(reply_packet) == 44);

using request_bytes = std::array<std::byte, sizeof(request_packet)>;
using reply_bytes = std::array<std::byte, sizeof(reply_packet)>;

inline request_bytes pack_request() noexcept {
    return std::bit_cast<request_bytes>(request_packet{htobe16(request_type), htobe16(sizeof(request_packet))});
}

inline bool is_request(const request_bytes& bytes) noexcept {
    const auto packet = std::bit_cast<request_packet>(bytes);
    return be16toh(packet.type) == request_type && be16toh(packet.length) == sizeof(request_packet);
}

inline std::uint64_t to_network(double value) noexcept { return htobe64(std::bit_cast<std::uint64_t>(value)); }
inline double from_network(std::uint64_t bits) noexcept { return std::bit_cast<double>(be64toh(bits)); }

inline reply_bytes pack_reply(const localization& value) noexcept {
    return std::bit_cast<reply_bytes>(reply_packet{htobe16(reply_type),
                                                   htobe16(sizeof(reply_packet)),
                                                   {to_network(value.utc), to_network(value.lat), to_network(value.lon),
                                                    to_network(value.velocity), to_network(value.acceleration)}});
}

/// Empty if the bytes are not a reply.
inline std::optional<localization> unpack_reply(const reply_bytes& bytes) noexcept {
    const auto packet = std::bit_cast<reply_packet>(bytes);
    if (be16toh(packet.type) != reply_type || be16toh(packet.length) != sizeof(reply_packet)) {
        return std::nullopt;
    }
    return localization{from_network(packet.values[0]), from_network(packet.values[1]), from_network(packet.values[2]),
                        from_network(packet.values[3]), from_network(packet.values[4])};
}

} // namespace cles::perf::icd
