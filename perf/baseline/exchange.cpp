// SPDX-License-Identifier: BSL-1.0
#include "exchange.hpp"

#include "packet.hpp"

#include <exception>
#include <stdexcept>

#include <sys/socket.h>

namespace cles::perf::icd {

void server::run() {
    if (listener_.where.scheme == "udp") {
        serve_datagrams();
    }
    for (;;) {
        const auto client = accept_from(listener_);
        try {
            serve(client.get());
        } catch (const std::exception&) {
            continue; // the client has disconnected or uses another protocol
        }
    }
}

void server::serve(int client) {
    request_bytes request;
    while (receive_all(client, request) && is_request(request)) {
        send_all(client, pack_reply(sample(served_++)));
    }
}

void server::serve_datagrams() {
    const int socket = listener_.socket.get();
    for (;;) {
        request_bytes request;
        sockaddr_storage from{};
        socklen_t length = sizeof from;
        auto* const whom = reinterpret_cast<sockaddr*>(&from);
        const auto got = ::recvfrom(socket, request.data(), request.size(), MSG_TRUNC, whom, &length);
        if (got == static_cast<ssize_t>(request.size()) && is_request(request)) {
            const auto reply = pack_reply(sample(served_++));
            ::sendto(socket, reply.data(), reply.size(), 0, whom, length); // a lost reply ends the measurement
        }
    }
}

localization client::pull() {
    send_all(socket_.get(), pack_request());
    reply_bytes reply;
    if (!receive_all(socket_.get(), reply)) {
        throw std::runtime_error("the hand-written server closed the connection");
    }
    const auto value = unpack_reply(reply);
    if (!value) {
        throw std::runtime_error("the hand-written server sent something that is not a reply");
    }
    return *value;
}

} // namespace cles::perf::icd
