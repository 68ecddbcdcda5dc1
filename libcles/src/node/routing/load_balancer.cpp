// SPDX-License-Identifier: BSL-1.0
#include "node/routing/load_balancer.hpp"

#include "node/session/request_checks.hpp"

#include <algorithm>
#include <iterator>

namespace cles::core {

bool is_better(const candidate& a, const candidate& b) noexcept {
    // The work there, including one more, per worker; times the service time if both report it.
    const auto share = [](const candidate& c) {
        return static_cast<double>(c.estimated_work() + 1) /
               static_cast<double>(std::max<std::uint32_t>(c.load.workers, 1));
    };
    const bool timed = a.load.service_us != 0 && b.load.service_us != 0;
    const auto wait_a = share(a) * (timed ? a.load.service_us : 1);
    const auto wait_b = share(b) * (timed ? b.load.service_us : 1);
    return wait_a < wait_b;
}

candidate* power_of_two_choices::select(std::span<candidate* const> all) noexcept {
    const auto count = all.size();
    if (count < 2) {
        return count == 0 ? nullptr : all.front();
    }
    const auto first = draws_.below(count);
    auto second = draws_.below(count - 1);
    second += second >= first ? 1 : 0;
    return is_better(*all[second], *all[first]) ? all[second] : all[first];
}

bool offers(const node_state& n, verb v, std::string_view task) {
    if (task == "cles") {
        return v == verb::pull;
    }
    if (v == verb::bind) {
        return n.tasks.can_bind(task) || n.published.knows(task);
    }
    return n.tasks.find(v, task) != nullptr;
}

bool load_balancer::gather(const protocol::request_line& r, const request_origin& by,
                           const std::vector<std::string>& asked) {
    bool not_forwarded = false;
    const auto was_asked = [&](std::string_view name) {
        return std::find(asked.begin(), asked.end(), name) != asked.end();
    };
    const auto may_ask = [&](std::string_view name) {
        const auto found = may_pass_on(node_, by, name, r.verb, r.noun);
        not_forwarded = not_forwarded || found == passage::not_forwarded;
        return found == passage::permitted;
    };
    const bool here =
        offers(node_, r.verb, r.noun.task) && !was_asked(node_.name) && permits(node_, by, node_.name, r.verb, r.noun);
    if (here) {
        here_.update_load(node_.load_now()); // before the list is built: the program's function may send requests
    }
    all_.clear();
    if (here) {
        all_.push_back(&here_);
    }
    if (r.hops == 0) {
        return false;
    }
    for (const auto& o : others_.offers(r.verb, r.noun.task)) {
        if (o.by->live && o.by->reachable() && (r.via.empty() || !is_in_via(r.via, o.by->name)) &&
            (asked.empty() || !was_asked(o.by->name)) && may_ask(o.by->name)) {
            all_.push_back(o.by);
        }
    }
    return not_forwarded;
}

load_balancer::chosen load_balancer::choose(const protocol::request_line& r, const request_origin& by,
                                            const std::vector<std::string>& asked, time_point now) {
    const bool not_forwarded = gather(r, by, asked);
    at_once_.clear();
    std::copy_if(all_.begin(), all_.end(), std::back_inserter(at_once_),
                 [now](const candidate* c) { return c->avoid_until <= now; });
    // Work that is given to a node whose workers are occupied may wait there until its deadline.
    if (std::any_of(at_once_.begin(), at_once_.end(), [](const candidate* c) { return c->is_free(); })) {
        std::erase_if(at_once_, [](const candidate* c) { return c->is_saturated(); });
    }
    auto* found = selector_.select(at_once_.empty() ? all_ : at_once_);
    if (found == nullptr) {
        return {.not_forwarded = not_forwarded};
    }
    if (found == &here_) {
        const auto* h = node_.tasks.find(r.verb, r.noun.task);
        return {.here = true, .idempotent = h == nullptr || h->info.idempotent};
    }
    const auto& list = others_.offers(r.verb, r.noun.task);
    const auto offer = std::find_if(list.begin(), list.end(), [&](const auto& o) { return o.by == found; });
    return {.other = offer->by, .idempotent = offer->idempotent};
}

} // namespace cles::core
