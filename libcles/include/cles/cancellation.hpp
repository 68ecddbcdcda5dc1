// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/associator.hpp>
#include <boost/asio/cancellation_type.hpp>
#include <boost/asio/dispatch.hpp>

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

/// The same where the slot may be emitted on another executor than the service's, on which it is withdrawn then.
template <class Slot, class F>
void connect_slot(Slot slot, bool elsewhere, const boost::asio::any_io_executor& service, F withdraw) {
    if (!elsewhere) {
        connect_slot(slot, std::move(withdraw));
    } else if (slot.is_connected()) {
        connect_slot(slot, [service, withdraw = std::move(withdraw)] { boost::asio::dispatch(service, withdraw); });
    }
}

/// To be called when the operation has ended, before its handler is called: what is emitted from then on is none of
/// its business, nor of what it has made.
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

/// A handler that is called on an executor of its own, where its slot is emitted too, and so is released there.
template <class Handler>
struct slot_releasing {
    Handler handler;

    template <class... A>
    void operator()(A&&... arguments) {
        release_slot(handler);
        std::move(handler)(std::forward<A>(arguments)...);
    }
};

} // namespace cles::detail

template <template <class, class> class Associator, class Handler, class DefaultCandidate>
struct boost::asio::associator<Associator, cles::detail::slot_releasing<Handler>, DefaultCandidate>
    : Associator<Handler, DefaultCandidate> {
    static auto get(const cles::detail::slot_releasing<Handler>& h) noexcept {
        return Associator<Handler, DefaultCandidate>::get(h.handler);
    }
    static auto get(const cles::detail::slot_releasing<Handler>& h, const DefaultCandidate& candidate) noexcept {
        return Associator<Handler, DefaultCandidate>::get(h.handler, candidate);
    }
};
