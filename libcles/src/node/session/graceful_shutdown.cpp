// SPDX-License-Identifier: BSL-1.0
#include "node/session/graceful_shutdown.hpp"

#include "node/base/scoped_flag.hpp"
#include "node/local_node.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

graceful_shutdown::graceful_shutdown(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit,
                                     detail::pending_ptr done)
    : host_(host), ticket_(ticket), done_(std::move(done)) {
    const auto longest = std::chrono::milliseconds{std::chrono::hours{24}};
    host_.deadlines().arm(*this, host_.now() + std::clamp(limit, std::chrono::milliseconds{0}, longest));
}

bool graceful_shutdown::has_running_requests() const {
    const auto all = host_.connections().all();
    return std::any_of(all.begin(), all.end(), [](const auto& c) { return c->session().serving().in_flight() != 0; });
}

void graceful_shutdown::check() {
    if (looking_ || !done_) {
        return;
    }
    const core::scoped_flag during{looking_};
    if (ending_ || !has_running_requests()) {
        end_links();
    }
}

// Includes links that have been accepted since the last call. A link ends when its peer has closed it too, and so has
// read everything.
void graceful_shutdown::end_links() {
    if (!std::exchange(ending_, true)) {
        host_.deadlines().arm(*this, host_.now() + host_.bounds().discard);
    }
    bool open = false;
    for (const auto& c : host_.connections().all()) {
        if (c->datagram() == 0) {
            c->session().send_leave_notice();
            open = true;
        } else {
            c->flush();
        }
    }
    if (!open) {
        end();
    }
}

void graceful_shutdown::on_deadline(time_point) {
    if (ending_) { // some peers do not close
        end();
        return;
    }
    const core::scoped_flag during{looking_};
    for (const auto& c : host_.connections().all()) {
        c->session().serving().abort_running();
    }
    end_links(); // without waiting for peers that do not read
}

void graceful_shutdown::end() {
    host_.deadlines().disarm(*this);
    if (done_) { // else `give_up` has returned it
        host_.node().completions.succeed(std::move(done_), "{}");
    }
}

detail::pending_ptr graceful_shutdown::give_up() {
    host_.deadlines().disarm(*this);
    return std::move(done_);
}

} // namespace cles::core
