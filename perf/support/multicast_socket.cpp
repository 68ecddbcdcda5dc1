// SPDX-License-Identifier: BSL-1.0
#include "multicast_socket.hpp"

#include "bare_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::perf {
namespace {

constexpr int buffer_bytes = 1 << 20; // the system may limit it

sockaddr_in address_of(const multicast_group& group) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(group.port);
    checked(::inet_pton(AF_INET, group.address.c_str(), &address.sin_addr), "the group's address");
    return address;
}

template <class T>
void set(const descriptor& socket, int level, int option, const T& value, const char* name) {
    checked(::setsockopt(socket.get(), level, option, &value, sizeof value), name);
}

ip_mreqn on_loopback(const in_addr& group) {
    ip_mreqn request{};
    request.imr_multiaddr = group;
    request.imr_address.s_addr = htonl(INADDR_LOOPBACK);
    return request;
}

void bind_to(const descriptor& socket, sockaddr_in& address) {
    checked(::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), "bind");
}

} // namespace

reserved_group::reserved_group() : socket_(datagram_socket()) {
    set(socket_, IPPROTO_IP, IP_MULTICAST_ALL, 0,
        "IP_MULTICAST_ALL"); // ignores groups that only other sockets have joined
    auto address = address_of(group_);
    bind_to(socket_, address);
    socklen_t length = sizeof address;
    checked(::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &length), "getsockname");
    group_.port = ntohs(address.sin_port);
    // Only now, so that the port was unused when it was chosen.
    set(socket_, SOL_SOCKET, SO_REUSEADDR, 1, "SO_REUSEADDR");
}

descriptor join(const multicast_group& group) {
    auto socket = datagram_socket();
    auto address = address_of(group);
    set(socket, SOL_SOCKET, SO_REUSEADDR, 1, "SO_REUSEADDR");
    set(socket, SOL_SOCKET, SO_RCVBUF, buffer_bytes, "SO_RCVBUF");
    set(socket, IPPROTO_IP, IP_MULTICAST_ALL, 0, "IP_MULTICAST_ALL");
    bind_to(socket, address);
    set(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, on_loopback(address.sin_addr), "IP_ADD_MEMBERSHIP");
    return socket;
}

descriptor connect_to(const multicast_group& group) {
    auto socket = datagram_socket();
    const auto address = address_of(group);
    set(socket, IPPROTO_IP, IP_MULTICAST_IF, on_loopback(address.sin_addr), "IP_MULTICAST_IF");
    set(socket, IPPROTO_IP, IP_MULTICAST_TTL, 1, "IP_MULTICAST_TTL");
    checked(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), "connect");
    return socket;
}

} // namespace cles::perf
