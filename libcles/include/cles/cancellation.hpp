// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/cancellation_type.hpp>

#include <utility>

/// Cancellation of operations by their handler's cancellation slot. Not for applications.

namespace cles::detail {

/// Connects `withdraw` to the slot. It is called for every type of cancellation, because cancelled operations of the
/// library have no partial side effects. The operation's handler is not called from inside the emission.
template <class Slot, class F>
void connect_slot(Slot slot, F withdraw) {
    if (slot.is_connected()) {
        slot.assign([withdraw = std::move(withdraw)](boost::asio::cancellation_type type) {
            if (type != boost::asio::cancellation_type::none) {
                withdraw();
            }
        });
    }
}

/// Disconnects the slot. Call it when the operation has ended, before its handler is called, so that later emissions
/// affect neither the operation nor those that the handler starts.
template <class Handler>
void release_slot(const Handler& handler) {
    auto slot = boost::asio::get_associated_cancellation_slot(handler);
    if constexpr (requires { slot.clear(); }) {
        if (slot.is_connected()) {
            slot.clear();
        }
    } else if (slot.is_connected()) {
        slot.assign([](boost::asio::cancellation_type) {});
    }
}

} // namespace cles::detail
