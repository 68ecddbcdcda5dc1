// SPDX-License-Identifier: BSL-1.0
#include "shell/departure.hpp"

#include "core/raised.hpp"
#include "shell/local_node.hpp"

#include <algorithm>
#include <utility>

namespace cles::shell {

departure::departure(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit, detail::pending_ptr done)
    : host_(host), ticket_(ticket), done_(std::move(done)) {
    const auto longest = std::chrono::milliseconds{std::chrono::hours{24}};
    host_.deadlines().arm(*this, host_.now() + std::clamp(limit, std::chrono::milliseconds{0}, longest));
}

bool departure::something_runs() const {
    const auto all = host_.connections().all();
    return std::any_of(all.begin(), all.end(), [](const auto& c) { return c->session().serving().in_flight() != 0; });
}

void departure::look() {
    if (looking_ || !done_) {
        return;
    }
    const core::raised during{looking_};
    if (ending_ || !something_runs()) {
        end_links();
    }
}

// Those too that have come since the last time. A link has ended when its peer has ended it as well, which then has
// read all that was said.
void departure::end_links() {
    if (!std::exchange(ending_, true)) {
        host_.deadlines().arm(*this, host_.now() + host_.bounds().discard);
    }
    bool open = false;
    for (const auto& c : host_.connections().all()) {
        if (c->datagram() == 0) {
            c->session().say_that_it_leaves();
            open = true;
        } else {
            c->flush();
        }
    }
    if (!open) {
        end();
    }
}

void departure::on_deadline(time_point) {
    if (ending_) { // some do not end
        end();
        return;
    }
    const core::raised during{looking_};
    for (const auto& c : host_.connections().all()) {
        c->session().serving().cut_short();
    }
    end_links(); // whatever a peer that does not read still waits for
}

void departure::end() {
    host_.deadlines().disarm(*this);
    if (done_) { // else it has been given up meanwhile
        host_.node().completions.succeed(std::move(done_), "{}");
    }
}

detail::pending_ptr departure::give_up() {
    host_.deadlines().disarm(*this);
    return std::move(done_);
}

} // namespace cles::shell
