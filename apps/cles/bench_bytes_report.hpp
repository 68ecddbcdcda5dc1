// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// What the localization packet takes on the wire.
namespace tool {

/// What stands around a message that has a packet of the network to itself.
struct header_bytes {
    std::uint64_t ethernet = 14;
    std::uint64_t ipv4 = 20;
    std::uint64_t tcp = 32; ///< 20, and 12 of timestamps
    std::uint64_t udp = 8;
    std::uint64_t mtu = 1500; ///< what an Ethernet frame holds at most, from IP's header on
};
BOOST_DESCRIBE_STRUCT(header_bytes, (), (ethernet, ipv4, tcp, udp, mtu))

/// Bytes of a message, alone and in a frame of its own.
struct message_size {
    double bytes = 0;
    double frame = 0;
};
BOOST_DESCRIBE_STRUCT(message_size, (), (bytes, frame))

struct bytes_row {
    std::string message{}; ///< "PULL request"
    message_size icd_tcp{};
    message_size icd_udp{};
    message_size tcp{};
    message_size udp{};
    double ratio_tcp = 0; ///< of the frames
    double ratio_udp = 0;
};
BOOST_DESCRIBE_STRUCT(bytes_row, (), (message, icd_tcp, icd_udp, tcp, udp, ratio_tcp, ratio_udp))

/// How many published packets one full frame holds.
struct updates_per_frame {
    std::uint64_t icd_tcp = 0;
    std::uint64_t icd_udp = 0;
    std::uint64_t tcp = 0;
    std::uint64_t udp = 1; ///< a datagram holds exactly one message
};
BOOST_DESCRIBE_STRUCT(updates_per_frame, (), (icd_tcp, icd_udp, tcp, udp))

struct bytes_report {
    std::string bench = "bytes";
    std::uint64_t exchanges = 0; ///< of each verb
    header_bytes headers{};
    std::vector<bytes_row> rows{};
    updates_per_frame in_a_frame{};
};
BOOST_DESCRIBE_STRUCT(bytes_report, (), (bench, exchanges, headers, rows, in_a_frame))

std::string table_of(const bytes_report& report);

} // namespace tool
