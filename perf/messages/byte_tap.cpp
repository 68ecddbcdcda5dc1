// SPDX-License-Identifier: BSL-1.0
#include "byte_tap.hpp"

#include <array>
#include <cstddef>
#include <exception>
#include <span>

#include <poll.h>
#include <sys/socket.h>

namespace cles::perf {
namespace {

using buffer = std::array<std::byte, 65536>;

/// Forwards what has arrived; false at the end of the stream.
bool pass(int from, int to, std::atomic<std::uint64_t>& count, buffer& space) {
    const auto got = ::recv(from, space.data(), space.size(), 0);
    if (got <= 0) {
        return false;
    }
    // Counted first, so that the count is complete when the answer arrives.
    count += static_cast<std::uint64_t>(got);
    send_all(to, std::span{space}.first(static_cast<std::size_t>(got)));
    return true;
}

} // namespace

byte_tap::byte_tap(const cles::url& target)
    : listener_(listen_on({.scheme = "tcp", .host = "127.0.0.1", .port = 0, .path = {}})), server_(connect_to(target)) {
}

std::string byte_tap::url() const { return to_string(listener_.where); }

void byte_tap::run(int stop) {
    buffer space;
    descriptor client;
    std::array<pollfd, 3> watched{{{.fd = stop, .events = POLLIN, .revents = 0},
                                   {.fd = listener_.socket.get(), .events = POLLIN, .revents = 0},
                                   {.fd = -1, .events = POLLIN, .revents = 0}}};
    try {
        while (::poll(watched.data(), watched.size(), -1) > 0 && watched[0].revents == 0) {
            if (client.get() < 0) {
                client = accept_from(listener_);
                watched[1].fd = server_.get();
                watched[2].fd = client.get();
                continue;
            }
            if (watched[1].revents != 0 && !pass(server_.get(), client.get(), to_client_, space)) {
                return;
            }
            if (watched[2].revents != 0 && !pass(client.get(), server_.get(), to_server_, space)) {
                return;
            }
        }
    } catch (const std::exception&) {
        return; // one of the ends has closed its connection; the other will notice
    }
}

} // namespace cles::perf
