// SPDX-License-Identifier: BSL-1.0
#include "node/secured/request_challenges.hpp"

#include "node/base/deadlines.hpp"
#include "node/node_state.hpp"
#include "node/session/request_checks.hpp"
#include "port/node_security.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <chrono>
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
                                                             time_point& due, time_point now) {
    auto what = key_of(link, r);
    const auto here = std::ranges::find(given_, what, &given::what);
    if (r.sig.empty()) {
        if (here != given_.end()) { // another attempt replaces it
            given_.erase(here);
        }
        return challenge(std::move(what), r.noun.task, due, now);
    }
    const auto sig = protocol::parse_request_signature(r.sig);
    const auto is_signed = [&](const given& each) {
        return sig && each.due > now &&
               node_.security->is_request_signed(what.requester, each.challenge, what.how, what.path, r.body, *sig);
    };
    // Another node may forward the second attempt than the first one, such as another bridge of a pool.
    const auto valid = std::ranges::find_if(
        given_, [&](const given& each) { return each.what.is_same_request(what) && is_signed(each); });
    if (valid != given_.end()) {
        // The challenge is older than the signature. So the request never runs after its requester has stopped waiting.
        const auto last = saturating_add(valid->issued, std::chrono::milliseconds{sig->waits_ms});
        given_.erase(valid);
        due = std::min(due, last);
        return last > now ? std::nullopt
                          : std::optional{not_accepted(r.noun.task, what.requester + " has stopped waiting")};
    }
    const bool is_open = here != given_.end() && here->due > now;
    if (here != given_.end()) { // a wrong signature uses it up
        given_.erase(here);
    }
    if (!sig) {
        return not_accepted(r.noun.task, "it has not the form <signature>.<ms> of version 2: requester and executing "
                                         "node are upgraded together");
    }
    return not_accepted(r.noun.task, is_open ? "it is not that of " + what.requester + " for this request"
                                             : "there is no challenge for this request, or it has expired");
}

protocol::failure request_challenges::not_accepted(std::string_view task, std::string_view why) const {
    return {.code = errc::denied,
            .message = std::string{node_.name}
                           .append(" does not accept the signature for '")
                           .append(task)
                           .append("': ")
                           .append(why)};
}

bool request_challenges::request_key::is_same_request(const request_key& other) const {
    return requester == other.requester && how == other.how && path == other.path && body == other.body;
}

protocol::failure request_challenges::challenge(request_key what, std::string_view task, time_point due,
                                                time_point now) {
    make_space(what.link, now);
    auto text = node_.security->new_challenge();
    // A node that forwards may state any deadline.
    const auto last = saturating_add(now, std::chrono::milliseconds{protocol::default_deadline(what.how)});
    given_.push_back({.what = std::move(what), .challenge = text, .issued = now, .due = std::min(due, last)});
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
