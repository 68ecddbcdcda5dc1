// SPDX-License-Identifier: BSL-1.0
#include <cles/job_feed.hpp>

namespace cles {

job_feed::job_feed(std::shared_ptr<detail::job_feed_control> control) {
    if (auto* const made = control.get()) {
        control_.reset(made, [kept = std::move(control)](detail::job_feed_control* last) { last->close(); });
    }
}

void job_feed::next(event_callback taken) const {
    if (!control_) {
        throw error(errc::closed, "the feed is not open");
    }
    control_->next(std::move(taken));
}

void job_feed::close() const noexcept {
    if (control_) {
        control_->close();
    }
}

} // namespace cles
