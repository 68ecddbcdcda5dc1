// SPDX-License-Identifier: BSL-1.0
#include <cles/responder.hpp>

#include "core/handler_failure.hpp"

namespace cles::detail {

void fail_with(call_control& call, const std::exception_ptr& thrown) {
    const auto why = core::describe(thrown);
    call.fail(why.code, why.message);
}

} // namespace cles::detail
