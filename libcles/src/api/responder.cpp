// SPDX-License-Identifier: BSL-1.0
#include <cles/responder.hpp>

#include "node/session/handler_failure.hpp"

#include <boost/asio/any_io_executor.hpp>

namespace cles {
namespace detail {

boost::asio::any_io_executor call_control::executor() const { throw error(errc::failed, "a plugin has no executor"); }

void fail_with(call_control& call, const std::exception_ptr& thrown) {
    const auto why = core::describe(thrown);
    call.fail(why.code, why.message);
}

} // namespace detail

boost::asio::any_io_executor responder::get_executor() const { return call_->executor(); }

} // namespace cles
