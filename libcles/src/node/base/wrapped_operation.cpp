// SPDX-License-Identifier: BSL-1.0
#include "node/base/wrapped_operation.hpp"

namespace cles::core {

detail::pending::verdict wrapped_operation::offer(std::string_view json) {
    return pass_on([&](detail::pending& p) { return p.offer(json); });
}

void wrapped_operation::fail(boost::system::error_code code, std::string_view message) {
    const std::unique_ptr<wrapped_operation> self{this};
    take_operation().release()->fail(code, message);
}

} // namespace cles::core
