// SPDX-License-Identifier: BSL-1.0
#include <cles/coroutine_handler.hpp>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>

namespace cles::detail {

void spawn_handler(const responder& answer, boost::asio::awaitable<void> work) {
    auto signal = std::make_shared<boost::asio::cancellation_signal>();
    answer.on_stop([signal] { signal->emit(boost::asio::cancellation_type::terminal); });
    // The completion keeps the signal, which must outlive the coroutine.
    boost::asio::co_spawn(answer.get_executor(), std::move(work),
                          boost::asio::bind_cancellation_slot(signal->slot(), [signal](std::exception_ptr) {}));
}

} // namespace cles::detail
