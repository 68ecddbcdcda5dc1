// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/cancellation_type.hpp>

#include <utility>

/// How every operation is withdrawn by its handler's cancellation slot. Not for applications.

namespace cles::detail {

/// Has `withdraw` called when the slot is emitted, whatever the type of cancellation: an operation of the library that
/// is withdrawn leaves nothing half done. Its handler is not called from inside the emission.
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

/// To be called when the operation has ended, before its handler is called: later emissions concern neither it nor the
/// operations that its handler starts.
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
