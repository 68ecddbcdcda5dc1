// SPDX-License-Identifier: BSL-1.0
#include "datagram_tap.hpp"

#include "perf/support/bare_socket.hpp"

#include <array>
#include <cstddef>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

namespace cles::perf {
namespace {

sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(port);
    return address;
}

const sockaddr* generic(const sockaddr_in& address) { return reinterpret_cast<const sockaddr*>(&address); }
sockaddr* generic(sockaddr_in& address) { return reinterpret_cast<sockaddr*>(&address); }

descriptor bound_socket() {
    auto socket = datagram_socket();
    const auto here = loopback(0);
    checked(::bind(socket.get(), generic(here), sizeof here), "bind");
    return socket;
}

descriptor connected_socket(std::uint16_t port) {
    auto socket = datagram_socket();
    const auto there = loopback(port);
    checked(::connect(socket.get(), generic(there), sizeof there), "connect");
    return socket;
}

} // namespace

datagram_tap::datagram_tap(const cles::url& target) : client_(bound_socket()), server_(connected_socket(target.port)) {}

std::string datagram_tap::url() const {
    sockaddr_in address{};
    socklen_t length = sizeof address;
    checked(::getsockname(client_.get(), generic(address), &length), "getsockname");
    return to_string(cles::url{.scheme = "udp", .host = "127.0.0.1", .port = ntohs(address.sin_port), .path = {}});
}

// What cannot be forwarded is lost, as datagrams may be.
void datagram_tap::run(int stop) {
    std::array<std::byte, 65536> space{};
    sockaddr_in client{};
    std::array<pollfd, 3> watched{{{.fd = stop, .events = POLLIN, .revents = 0},
                                   {.fd = client_.get(), .events = POLLIN, .revents = 0},
                                   {.fd = server_.get(), .events = POLLIN, .revents = 0}}};
    while (::poll(watched.data(), watched.size(), -1) > 0 && watched[0].revents == 0) {
        if (watched[1].revents != 0) {
            socklen_t length = sizeof client;
            const auto got = ::recvfrom(client_.get(), space.data(), space.size(), 0, generic(client), &length);
            if (got > 0) {
                // Counted first, so that the count is complete when the answer arrives.
                to_server_ += static_cast<std::uint64_t>(got);
                ::send(server_.get(), space.data(), static_cast<std::size_t>(got), 0);
            }
        }
        if (watched[2].revents != 0) {
            const auto got = ::recv(server_.get(), space.data(), space.size(), 0);
            if (got > 0) {
                to_client_ += static_cast<std::uint64_t>(got);
                ::sendto(client_.get(), space.data(), static_cast<std::size_t>(got), 0, generic(client), sizeof client);
            }
        }
    }
}

} // namespace cles::perf
