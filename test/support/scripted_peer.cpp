// SPDX-License-Identifier: BSL-1.0
#include "support/scripted_peer.hpp"

#include "support/run_until.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace cles::test {
namespace {

struct address {
    sockaddr_storage storage{};
    socklen_t size = 0;

    [[nodiscard]] const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&storage); }
};

address address_of(const url& where) {
    address result;
    if (where.scheme == "unix") {
        sockaddr_un un{};
        un.sun_family = AF_UNIX;
        std::memcpy(un.sun_path, where.path.data(), where.path.size());
        const bool abstract = where.path.starts_with('@');
        if (abstract) {
            un.sun_path[0] = '\0';
        }
        std::memcpy(&result.storage, &un, sizeof un);
        result.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + where.path.size() + (abstract ? 0 : 1));
    } else if (where.host.find(':') != std::string::npos) {
        sockaddr_in6 in{};
        in.sin6_family = AF_INET6;
        in.sin6_port = htons(where.port);
        ::inet_pton(AF_INET6, where.host.c_str(), &in.sin6_addr);
        std::memcpy(&result.storage, &in, sizeof in);
        result.size = sizeof in;
    } else {
        sockaddr_in in{};
        in.sin_family = AF_INET;
        in.sin_port = htons(where.port);
        ::inet_pton(AF_INET, where.host.c_str(), &in.sin_addr);
        std::memcpy(&result.storage, &in, sizeof in);
        result.size = sizeof in;
    }
    return result;
}

void check(int result, const char* what) {
    if (result < 0) {
        throw std::system_error{errno, std::generic_category(), what};
    }
}

} // namespace

scripted_peer::scripted_peer(boost::asio::io_context& io, std::string_view url, buffers size) : io_(&io) {
    const auto where = address_of(parse_url(url));
    descriptor_ = ::socket(where.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    check(descriptor_, "socket");
    if (size == buffers::small) { // before connecting: TCP slows down when a window shrinks later
        const int little = 4096;
        ::setsockopt(descriptor_, SOL_SOCKET, SO_RCVBUF, &little, sizeof little);
    }
    check(::connect(descriptor_, where.get(), where.size), "connect");
}

scripted_peer::scripted_peer(scripted_peer&& other) noexcept
    : io_(other.io_), descriptor_(std::exchange(other.descriptor_, -1)), input_(std::move(other.input_)),
      taken_(other.taken_), ended_(other.ended_), reset_(other.reset_) {}

scripted_peer& scripted_peer::operator=(scripted_peer&& other) noexcept {
    close();
    io_ = other.io_;
    descriptor_ = std::exchange(other.descriptor_, -1);
    input_ = std::move(other.input_);
    taken_ = other.taken_;
    ended_ = other.ended_;
    reset_ = other.reset_;
    return *this;
}

std::size_t scripted_peer::send_some(std::string_view bytes) {
    const auto count = ::send(descriptor_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count < 0) {
        if (errno != EAGAIN) {
            throw std::system_error{errno, std::generic_category(), "send"};
        }
        return 0;
    }
    return static_cast<std::size_t>(count);
}

void scripted_peer::send(std::string_view bytes, const place& where) {
    run_until(
        *io_,
        [&] {
            bytes.remove_prefix(send_some(bytes));
            return bytes.empty();
        },
        patience, where);
}

void scripted_peer::read_ready() {
    input_.erase(0, std::exchange(taken_, 0));
    std::array<char, 65536> space;
    while (!ended_ && descriptor_ >= 0) {
        const auto count = ::recv(descriptor_, space.data(), space.size(), MSG_DONTWAIT);
        if (count > 0) {
            input_.append(space.data(), static_cast<std::size_t>(count));
        } else if (count == 0) {
            ended_ = true;
        } else if (errno == EAGAIN) {
            return;
        } else {
            ended_ = reset_ = true;
        }
    }
}

std::string scripted_peer::line(const place& where) {
    std::size_t end = std::string::npos;
    run_until(
        *io_,
        [&] {
            end = input_.find('\n', taken_);
            if (end == std::string::npos) {
                read_ready();
                end = input_.find('\n', taken_);
            }
            if (end == std::string::npos && ended_) {
                BOOST_FAIL("the stream ended where a line was expected, at line " + std::to_string(where.line()) +
                           " of " + where.file_name());
            }
            return end != std::string::npos;
        },
        patience, where);
    auto result = input_.substr(taken_, end - taken_);
    taken_ = end + 1;
    return result;
}

std::string scripted_peer::ask(std::string_view line, const place& where) {
    send(std::string{line} + "\n", where);
    return this->line(where);
}

bool scripted_peer::ended() {
    read_ready();
    return ended_;
}

std::string scripted_peer::rest(const place& where) {
    run_until(
        *io_, [this] { return ended(); }, patience, where);
    return std::exchange(input_, {}).substr(std::exchange(taken_, 0));
}

void scripted_peer::shut() { ::shutdown(descriptor_, SHUT_WR); }

void scripted_peer::reset() {
    const linger at_once{.l_onoff = 1, .l_linger = 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close();
}

void scripted_peer::close() {
    if (descriptor_ >= 0) {
        ::close(std::exchange(descriptor_, -1));
    }
}

scripted_listener::scripted_listener(boost::asio::io_context& io, std::string_view url, int backlog)
    : io_(io), descriptor_(-1), where_(parse_url(url)) {
    auto local = address_of(where_);
    descriptor_ = ::socket(local.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    check(descriptor_, "socket");
    const int yes = 1;
    ::setsockopt(descriptor_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    check(::bind(descriptor_, local.get(), local.size), "bind");
    check(::listen(descriptor_, backlog), "listen");
    if (where_.scheme == "tcp") {
        local.size = sizeof local.storage;
        check(::getsockname(descriptor_, reinterpret_cast<sockaddr*>(&local.storage), &local.size), "getsockname");
        sockaddr_in in{};
        std::memcpy(&in, &local.storage, sizeof in);
        where_.port = ntohs(in.sin_port); // at the same offset for both families
    }
}

scripted_listener::~scripted_listener() { ::close(descriptor_); }

scripted_peer scripted_listener::accept(const std::source_location& where) {
    int taken = -1;
    run_until(
        io_,
        [&] {
            taken = ::accept4(descriptor_, nullptr, nullptr, SOCK_CLOEXEC);
            return taken >= 0;
        },
        patience, where);
    return {io_, taken};
}

} // namespace cles::test
