// SPDX-License-Identifier: BSL-1.0
#include "fan_out.hpp"

#include <algorithm>
#include <stdexcept>

namespace cles::perf {

void arrivals::take(const publication& value) {
    last_ = monotonic_ns();
    if (!is_sample(value)) {
        throw std::runtime_error("the received values are not those that were published");
    }
    first_published_ = count_ == 0 ? value.published_ns : std::min(first_published_, value.published_ns);
    ++count_;
    if (record_ != nullptr) {
        record_->record(std::chrono::nanoseconds{last_ - value.published_ns});
    }
}

} // namespace cles::perf
