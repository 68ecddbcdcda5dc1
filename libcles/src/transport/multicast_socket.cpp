// SPDX-License-Identifier: BSL-1.0
#include "transport/multicast_socket.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

#include <linux/filter.h>
#include <sys/socket.h>

namespace cles::transport {

namespace {

template <std::size_t N>
void attach(boost::asio::ip::udp::socket& socket, std::array<sock_filter, N>& program) noexcept {
    const sock_fprog filter{.len = static_cast<unsigned short>(N), .filter = program.data()};
    static_cast<void>(
        ::setsockopt(socket.native_handle(), SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter)); // see the header
}

} // namespace

void drop_from(boost::asio::ip::udp::socket& socket, const boost::asio::ip::udp::endpoint& source) noexcept {
    constexpr auto whole = UINT32_MAX;
    // A filter on a datagram socket sees the UDP header first; the IP header has an offset of its own.
    constexpr auto source_address = static_cast<std::uint32_t>(SKF_NET_OFF) + 12;
    std::array<sock_filter, 6> program{{
        {BPF_LD | BPF_H | BPF_ABS, 0, 0, 0}, // source port
        {BPF_JMP | BPF_JEQ | BPF_K, 0, 3, source.port()},
        {BPF_LD | BPF_W | BPF_ABS, 0, 0, source_address},
        {BPF_JMP | BPF_JEQ | BPF_K, 0, 1, source.address().to_v4().to_uint()},
        {BPF_RET | BPF_K, 0, 0, 0},
        {BPF_RET | BPF_K, 0, 0, whole},
    }};
    attach(socket, program);
}

void drop_all(boost::asio::ip::udp::socket& socket) noexcept {
    std::array<sock_filter, 1> program{{{BPF_RET | BPF_K, 0, 0, 0}}};
    attach(socket, program);
}

void drop_nothing(boost::asio::ip::udp::socket& socket) noexcept {
    const int unused = 0;
    static_cast<void>(::setsockopt(socket.native_handle(), SOL_SOCKET, SO_DETACH_FILTER, &unused, sizeof unused));
}

} // namespace cles::transport
