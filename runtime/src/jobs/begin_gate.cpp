// SPDX-License-Identifier: BSL-1.0
#include "jobs/begin_gate.hpp"

namespace cles::runtime {

// Before the loop has run, nothing has been read.
begin_gate::begin_gate(std::chrono::nanoseconds max_wait) noexcept
    : max_wait_(max_wait), open_until_(max_wait.count() > 0 ? time_point::min() : time_point::max()) {}

bool begin_gate::begin_round(time_point now) noexcept {
    if (closed_ || max_wait_.count() == 0) {
        return false;
    }
    if (now <= open_until_) {
        open_until_ = now + max_wait_;
        return false;
    }
    closed_ = true;
    begin_reading(now);
    return true;
}

void begin_gate::begin_reading(time_point now) noexcept {
    reading_since_ = now;
    last_round_ = now;
    quiet_ = 0;
    inputs_before_ = inputs_;
}

bool begin_gate::end_round(time_point now) noexcept {
    if (now - last_round_ > max_wait_) { // it has waited again
        begin_reading(now);
        return false;
    }
    last_round_ = now;
    quiet_ = inputs_ == inputs_before_ ? quiet_ + 1 : 0;
    inputs_before_ = inputs_;
    if (quiet_ < quiet_rounds && now - reading_since_ < max_reading) {
        return false;
    }
    closed_ = false;
    open_until_ = now + max_wait_;
    return true;
}

} // namespace cles::runtime
