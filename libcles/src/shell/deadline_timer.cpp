// SPDX-License-Identifier: BSL-1.0
#include "shell/deadline_timer.hpp"

#include <utility>

namespace cles::shell {

deadline_timer::deadline_timer(const boost::asio::any_io_executor& executor, const core::clock& time,
                               std::function<void(bool)> due)
    : timer_(executor), time_(time), due_(std::move(due)) {}

void deadline_timer::follow(const core::deadline_queue& deadlines) {
    const auto next = deadlines.next();
    if (!due_ || !next || (set_for_ && *set_for_ <= *next)) {
        return;
    }
    set_for_ = next;
    absence_.expect(*next, time_.now());
    timer_.set(*next);
    wait();
}

void deadline_timer::wait() {
    if (std::exchange(waiting_, true)) {
        return;
    }
    timer_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        self->waiting_ = false;
        if (code || !self->due_) {
            return;
        }
        if (!self->timer_.take()) { // it was set anew while this was on its way
            self->wait();
            return;
        }
        self->set_for_.reset();
        self->due_(self->absence_.ended(self->time_.now()));
    });
}

void deadline_timer::stop() {
    due_ = nullptr;
    timer_.cancel();
}

} // namespace cles::shell
