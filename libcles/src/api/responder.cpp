// SPDX-License-Identifier: BSL-1.0
#include <cles/coroutine_handler.hpp>
#include <cles/responder.hpp>

#include "node/session/handler_failure.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>

namespace cles {
namespace detail {

boost::asio::any_io_executor call_control::executor() const { throw error(errc::failed, "a plugin has no executor"); }

std::shared_ptr<job_feed_control> call_control::bind(job_feed_maker /*make*/, std::string_view /*noun*/,
                                                     const bind_options& /*options*/) {
    throw error(errc::failed, "a job has no feeds here");
}

const std::shared_ptr<core::call>& call_control::node_call() const noexcept {
    static const auto& none = *new std::shared_ptr<core::call>; // NOLINT(bugprone-unhandled-exception-at-new): ends it
    return none;
}

void fail_with(call_control& call, const std::exception_ptr& thrown) {
    const auto why = core::describe(thrown);
    call.fail(why.code, why.message);
}

void spawn_handler(const responder& answer, boost::asio::awaitable<void> work) {
    auto signal = std::make_shared<boost::asio::cancellation_signal>();
    answer.on_stop([signal] { signal->emit(boost::asio::cancellation_type::terminal); });
    // The completion keeps the signal, which must outlive the coroutine.
    boost::asio::co_spawn(answer.get_executor(), std::move(work),
                          boost::asio::bind_cancellation_slot(signal->slot(), [signal](std::exception_ptr) {}));
}

} // namespace detail

boost::asio::any_io_executor responder::get_executor() const { return call_->executor(); }

} // namespace cles
