// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "packet.hpp"
#include "perf/fan_out/fan_out.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

/// The packet of the fictitious interface control document for a publication, in network order:
///
/// | bytes | update                                             |
/// | ----- | -------------------------------------------------- |
/// | 2     | message type, 3                                    |
/// | 2     | total length, 56                                   |
/// | 4     | number, from 1, to detect missing updates          |
/// | 8     | when it was published, in nanoseconds              |
/// | 5 x 8 | utc, lat, lon, velocity, acceleration (IEEE)       |
namespace cles::perf::icd {

inline constexpr std::uint16_t update_type = 3;

struct [[gnu::packed]] update_packet {
    std::uint16_t type;
    std::uint16_t length;
    std::uint32_t number;
    std::uint64_t published_ns;
    std::uint64_t values[5];
};
static_assert(sizeof(update_packet) == 56);

using update_bytes = std::array<std::byte, sizeof(update_packet)>;

struct update {
    std::uint32_t number = 0;
    publication value{};
};

inline update_bytes pack_update(std::uint32_t number, const publication& value) noexcept {
    return std::bit_cast<update_bytes>(
        update_packet{htobe16(update_type),
                      htobe16(sizeof(update_packet)),
                      htobe32(number),
                      htobe64(static_cast<std::uint64_t>(value.published_ns)),
                      {to_network(value.utc), to_network(value.lat), to_network(value.lon), to_network(value.velocity),
                       to_network(value.acceleration)}});
}

/// Empty if the bytes are not an update. \pre there are at least as many as an update has
inline std::optional<update> unpack_update(std::span<const std::byte> bytes) noexcept {
    update_packet packet{};
    std::memcpy(&packet, bytes.data(), sizeof packet);
    if (be16toh(packet.type) != update_type || be16toh(packet.length) != sizeof packet) {
        return std::nullopt;
    }
    update read{.number = be32toh(packet.number)};
    read.value.published_ns = static_cast<std::int64_t>(be64toh(packet.published_ns));
    read.value.utc = from_network(packet.values[0]);
    read.value.lat = from_network(packet.values[1]);
    read.value.lon = from_network(packet.values[2]);
    read.value.velocity = from_network(packet.values[3]);
    read.value.acceleration = from_network(packet.values[4]);
    return read;
}

} // namespace cles::perf::icd
