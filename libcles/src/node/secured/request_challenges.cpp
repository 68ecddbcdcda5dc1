// SPDX-License-Identifier: BSL-1.0
#include "node/secured/request_challenges.hpp"

#include "node/node_state.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <functional>
#include <utility>

namespace cles::core {

request_challenges::request_key request_challenges::key_of(const identity& link,
                                                           const protocol::request_line& r) const {
    std::string scratch;
    return {.link = &link,
            .requester = std::string{requester_of(node_, link, r)},
            .how = r.verb,
            .path = std::string{protocol::canonical_path(r.noun, scratch)},
            .body = std::hash<std::string_view>{}(r.body)};
}

std::optional<protocol::failure> request_challenges::refusal(const identity& link, const protocol::request_line& r,
                                                             time_point due, time_point now) {
    auto what = key_of(link, r);
    const auto at = std::find_if(given_.begin(), given_.end(), [&](const given& each) { return each.what == what; });
    std::optional<given> open;
    if (at != given_.end()) { // another attempt replaces it, and a signature uses it up
        open = std::move(*at);
        given_.erase(at);
    }
    if (r.sig.empty()) {
        return challenge(std::move(what), r.noun.task, due, now);
    }
    const auto denied = [&](std::string_view why) {
        return protocol::failure{.code = errc::denied,
                                 .message = node_.name + " does not accept the signature for '" +
                                            std::string{r.noun.task} + "': " + std::string{why}};
    };
    if (!open || open->due <= now) {
        return denied("there is no challenge for this request, or it has expired");
    }
    if (!node_.security->is_request_signed(what.requester, open->challenge, what.how, what.path, r.body, r.sig)) {
        return denied("it is not that of " + what.requester + " for this request");
    }
    return std::nullopt;
}

protocol::failure request_challenges::challenge(request_key what, std::string_view task, time_point due,
                                                time_point now) {
    make_space(what.link, now);
    auto text = node_.security->new_challenge();
    given_.push_back({.what = std::move(what), .challenge = text, .due = due});
    return {.code = errc::denied,
            .message = node_.name + ": '" + std::string{task} + "' requires signed requests",
            .node = node_.name,
            .challenge = std::move(text)};
}

void request_challenges::make_space(const identity* link, time_point now) {
    given_.remove_if([now](const given& each) { return each.due <= now; });
    const auto of_link = [link](const given& each) { return each.what.link == link; };
    if (static_cast<std::size_t>(std::count_if(given_.begin(), given_.end(), of_link)) >= max_per_link) {
        given_.erase(std::find_if(given_.begin(), given_.end(), of_link));
    } else if (given_.size() >= max_in_all) {
        given_.pop_front();
    }
}

void request_challenges::forget(const identity& link) noexcept {
    given_.remove_if([&link](const given& each) { return each.what.link == &link; });
}

} // namespace cles::core
