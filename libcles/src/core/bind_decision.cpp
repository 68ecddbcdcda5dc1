// SPDX-License-Identifier: BSL-1.0
#include "core/bind_decision.hpp"

#include <utility>

namespace cles::core {

bool bind_decision::is_needed(const node& host, const protocol::request_line& r) {
    const auto* h = host.tasks.find(verb::bind, r.noun.task);
    return h != nullptr && h->start;
}

void bind_decision::ask(const protocol::request_line& r, const identity& peer, time_point due, time_point now) {
    const auto self = shared_from_this();
    asked_ = std::make_unique<local_request>(node_, self, 0);
    asked_->run(r, peer, due, now);
}

void bind_decision::withdraw() {
    const auto keep = shared_from_this();
    told_ = nullptr;
    if (asked_) {
        asked_->withdraw();
    }
}

void bind_decision::tell(const protocol::failure* why_not) {
    const auto keep = shared_from_this();
    if (const auto told = std::exchange(told_, nullptr)) {
        told(why_not);
    }
}

void bind_decision::on_result(std::size_t, std::string_view) { tell(nullptr); }

void bind_decision::on_failure(std::size_t, leg_failure why) { tell(&why.told); }

} // namespace cles::core
