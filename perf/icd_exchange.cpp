// SPDX-License-Identifier: BSL-1.0
#include "icd_exchange.hpp"

#include "icd_packet.hpp"

#include <exception>
#include <stdexcept>

namespace cles::perf::icd {

void server::run() {
    for (;;) {
        const auto client = accept_from(listener_);
        try {
            serve(client.get());
        } catch (const std::exception&) {
            continue; // that client is gone or speaks something else: the next one
        }
    }
}

void server::serve(int client) {
    request_bytes request;
    while (receive_all(client, request) && is_request(request)) {
        send_all(client, pack_reply(sample(served_++)));
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
        throw std::runtime_error("the hand-written server sent what is no reply");
    }
    return *value;
}

} // namespace cles::perf::icd
