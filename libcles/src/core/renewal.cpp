// SPDX-License-Identifier: BSL-1.0
#include "core/renewal.hpp"

#include "core/later.hpp"

#include <algorithm>

namespace cles::core {

void renewal::begin(time_point asked, std::chrono::milliseconds lease) {
    lease_ = lease;
    until_ = later(asked, lease);
    // At once, again and again, would be all the node does: a lease of next to nothing runs out in between instead.
    const auto third = std::max(lease / 3, std::chrono::milliseconds{1});
    deadlines_.arm(*this, later(asked, third - jitter_.quarter_of(third)));
}

void renewal::renewed(time_point asked) { begin(asked, lease_); }

bool renewal::put_off(time_point now) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until_ - now);
    constexpr std::chrono::milliseconds shortest{20};
    if (left < shortest) {
        return false;
    }
    const auto third = std::max(left / 3, shortest);
    deadlines_.arm(*this, later(now, third - jitter_.quarter_of(third)));
    return true;
}

void renewal::on_deadline(time_point) { owner_.renew(until_); }

} // namespace cles::core
