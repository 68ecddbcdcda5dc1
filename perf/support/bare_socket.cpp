// SPDX-License-Identifier: BSL-1.0
#include "bare_socket.hpp"

#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/un.h>

namespace cles::perf {
namespace {

constexpr int stream = SOCK_STREAM | SOCK_CLOEXEC;
constexpr int datagrams = SOCK_DGRAM | SOCK_CLOEXEC;
constexpr int max_silence_s = 10;

sockaddr_in address_of(const url& where) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    if (::inet_pton(AF_INET, where.host.c_str(), &address.sin_addr) != 1) {
        throw std::runtime_error(to_string(where) + ": listening requires an IPv4 address");
    }
    address.sin_port = htons(where.port);
    return address;
}

// The same as the library sets.
void tune(const descriptor& socket) {
    const int on = 1;
    checked(::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on), "TCP_NODELAY");
    checked(::setsockopt(socket.get(), SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on), "SO_KEEPALIVE");
}

descriptor connect_internet(const url& where) {
    const bool udp = where.scheme == "udp";
    addrinfo hints{};
    hints.ai_socktype = udp ? SOCK_DGRAM : SOCK_STREAM;
    addrinfo* found = nullptr;
    const int code = ::getaddrinfo(where.host.c_str(), std::to_string(where.port).c_str(), &hints, &found);
    if (code != 0) {
        throw std::runtime_error(to_string(where) + ": " + ::gai_strerror(code));
    }
    const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> addresses{found, &::freeaddrinfo};
    descriptor socket{checked(::socket(found->ai_family, udp ? datagrams : stream, 0), "socket")};
    if (udp) {
        const timeval silence{.tv_sec = max_silence_s, .tv_usec = 0};
        checked(::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &silence, sizeof silence), "SO_RCVTIMEO");
    } else {
        tune(socket);
    }
    checked(::connect(socket.get(), found->ai_addr, found->ai_addrlen), "connect");
    return socket;
}

struct unix_address {
    explicit unix_address(const url& where) {
        name.sun_family = AF_UNIX;
        if (where.path.size() >= sizeof name.sun_path) {
            throw std::runtime_error(to_string(where) + ": the path is too long for a socket");
        }
        std::memcpy(name.sun_path, where.path.data(), where.path.size());
        length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + where.path.size() + 1);
        if (where.path.starts_with('@')) { // abstract: begins with a zero, does not end with one
            name.sun_path[0] = '\0';
            --length;
        }
    }
    [[nodiscard]] const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&name); }

    sockaddr_un name{};
    socklen_t length = 0;
};

descriptor connect_unix(const url& where) {
    const unix_address address{where};
    descriptor socket{checked(::socket(AF_UNIX, stream, 0), "socket")};
    checked(::connect(socket.get(), address.get(), address.length), "connect");
    return socket;
}

listener listen_internet(const url& where) {
    const bool udp = where.scheme == "udp";
    listener made{descriptor{checked(::socket(AF_INET, udp ? datagrams : stream, 0), "socket")}, where};
    auto address = address_of(where);
    socklen_t length = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    checked(::bind(made.socket.get(), generic, length), "bind");
    if (!udp) {
        checked(::listen(made.socket.get(), SOMAXCONN), "listen");
    }
    checked(::getsockname(made.socket.get(), generic, &length), "getsockname");
    made.where.port = ntohs(address.sin_port);
    return made;
}

listener listen_unix(const url& where) {
    const unix_address address{where};
    listener made{descriptor{checked(::socket(AF_UNIX, stream, 0), "socket")}, where};
    checked(::bind(made.socket.get(), address.get(), address.length), "bind");
    checked(::listen(made.socket.get(), SOMAXCONN), "listen");
    return made;
}

} // namespace

listener listen_on(const url& where) {
    if (where.scheme == "tcp" || where.scheme == "udp") {
        return listen_internet(where);
    }
    if (where.scheme == "unix") {
        return listen_unix(where);
    }
    throw std::runtime_error(to_string(where) + ": not a URL of tcp, udp or unix");
}

descriptor accept_from(const listener& at) {
    descriptor accepted{checked(::accept4(at.socket.get(), nullptr, nullptr, SOCK_CLOEXEC), "accept")};
    if (at.where.scheme == "tcp") {
        tune(accepted);
    }
    return accepted;
}

descriptor connect_to(const url& where) {
    if (where.scheme == "tcp" || where.scheme == "udp") {
        return connect_internet(where);
    }
    if (where.scheme == "unix") {
        return connect_unix(where);
    }
    throw std::runtime_error(to_string(where) + ": not a URL of tcp, udp or unix");
}

descriptor datagram_socket() { return descriptor{checked(::socket(AF_INET, datagrams, 0), "socket")}; }

void send_all(int socket, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const auto sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) {
            continue;
        }
        bytes = bytes.subspan(static_cast<std::size_t>(checked(sent, "send")));
    }
}

bool receive_all(int socket, std::span<std::byte> bytes) {
    std::size_t have = 0;
    while (have < bytes.size()) {
        const auto got = ::recv(socket, bytes.data() + have, bytes.size() - have, 0);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0 && errno == EAGAIN) {
            throw std::runtime_error("no datagram arrived for " + std::to_string(max_silence_s) + " s");
        }
        if (checked(got, "recv") == 0) {
            if (have == 0) {
                return false;
            }
            throw std::runtime_error("the peer ended within a packet");
        }
        have += static_cast<std::size_t>(got);
    }
    return true;
}

} // namespace cles::perf
