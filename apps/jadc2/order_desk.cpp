// SPDX-License-Identifier: BSL-1.0
#include "order_desk.hpp"

#include <utility>

namespace jadc2 {

bool order_desk::has_one(double now) const { return open_ && (held_ || now - read_utc_ < lapse_s); }

bool order_desk::read_back(proposal what, double now) {
    if (open_ && held_) {
        return false;
    }
    open_ = std::move(what);
    read_utc_ = now;
    return true;
}

std::optional<order_desk::proposal> order_desk::confirm(double now) {
    const bool valid = has_one(now);
    auto out = std::exchange(open_, std::nullopt);
    held_ = false;
    return valid ? out : std::nullopt;
}

bool order_desk::hold(double now) {
    held_ = has_one(now);
    return held_;
}

bool order_desk::abort(double now) { return confirm(now).has_value(); }

} // namespace jadc2
