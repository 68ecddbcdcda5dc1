// SPDX-License-Identifier: BSL-1.0
#include "publisher.hpp"

#include "perf/support/clock.hpp"
#include "update_packet.hpp"

#include <array>
#include <span>

namespace cles::perf::icd {
namespace {

void publish(const fan_out_order& order, const std::vector<descriptor>& sockets) {
    auto next = monotonic_ns();
    for (std::uint64_t i = 0; i < order.updates; ++i) {
        if (order.interval_ns != 0) {
            next += static_cast<std::int64_t>(order.interval_ns);
            wait_until(next);
        }
        const auto packet = pack_update(static_cast<std::uint32_t>(i + 1), publish_sample(i));
        for (const auto& socket : sockets) {
            send_all(socket.get(), packet);
        }
    }
}

} // namespace

void publisher::run() {
    const auto control = accept_from(listener_);
    fan_out_order order;
    std::array<std::byte, 1> word{};
    std::vector<descriptor> sockets; // kept until the next order, because binders may still be reading
    while (receive_all(control.get(), std::as_writable_bytes(std::span{&order, 1}))) {
        sockets = sockets_for(order);
        if (!receive_all(control.get(), word)) {
            return;
        }
        publish(order, sockets);
        send_all(control.get(), word);
    }
}

std::vector<descriptor> publisher::sockets_for(const fan_out_order& order) {
    std::vector<descriptor> sockets;
    if (group_) {
        sockets.push_back(connect_to(*group_));
        return sockets;
    }
    for (std::uint64_t i = 0; i < order.binders; ++i) {
        sockets.push_back(accept_from(listener_));
    }
    return sockets;
}

} // namespace cles::perf::icd
