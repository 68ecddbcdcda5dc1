// SPDX-License-Identifier: BSL-1.0
#include "node/publish/lease.hpp"

#include "node/base/deadlines.hpp"

#include <algorithm>

namespace cles::core {

void renewal::begin(time_point asked, std::chrono::milliseconds lease) {
    lease_ = lease;
    until_ = saturating_add(asked, lease);
    // At least 1 ms: otherwise a tiny lease would be renewed all the time. It expires in between instead.
    const auto third = std::max(lease / 3, std::chrono::milliseconds{1});
    deadlines_.arm(*this, saturating_add(asked, third - jitter_.quarter_of(third)));
}

void renewal::renewed(time_point asked) { begin(asked, lease_); }

bool renewal::retry_later(time_point now) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until_ - now);
    constexpr std::chrono::milliseconds shortest{20};
    if (left < shortest) {
        return false;
    }
    const auto third = std::max(left / 3, shortest);
    deadlines_.arm(*this, saturating_add(now, third - jitter_.quarter_of(third)));
    return true;
}

void renewal::on_deadline(time_point) { owner_.renew(until_); }

} // namespace cles::core
