// SPDX-License-Identifier: BSL-1.0
#include "security/access/access_policy.hpp"

#include "protocol/exempt_nouns.hpp"
#include "security/access/wildcard.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {
namespace {

using cause = access_decision::cause;

bool is_exempt(const decoded_noun& noun) noexcept {
    const auto parameters = noun.parameters();
    return !parameters.empty() && protocol::is_exempt_from_rights(noun.task(), parameters.front());
}

bool may_forward_for(std::span<const std::string_view> patterns, std::string_view name) noexcept {
    return std::any_of(patterns.begin(), patterns.end(),
                       [&](std::string_view pattern) { return matches_name(pattern, name); });
}

} // namespace

access_policy::access_policy(std::string own_name, std::shared_ptr<const std::vector<member>> members,
                             local_rules rules)
    : own_name_(std::move(own_name)), members_(std::move(members)), rules_(std::move(rules)) {
    entries_.reserve(members_->size());
    by_name_.reserve(members_->size());
    for (const auto& each : *members_) {
        entry compiled{rights{each.may}, rights{each.offers}, {}};
        std::copy_if(each.forwards.begin(), each.forwards.end(), std::back_inserter(compiled.forwards),
                     is_name_pattern);
        by_name_.emplace(each.name, entries_.size());
        entries_.push_back(std::move(compiled));
    }
}

access_policy::access_policy(std::string own_name, const std::shared_ptr<const roster>& in_force, local_rules rules)
    : access_policy(std::move(own_name), std::shared_ptr<const std::vector<member>>{in_force, &in_force->members()},
                    std::move(rules)) {}

access_decision access_policy::received(std::string_view requester, std::string_view forwarder, verb asked,
                                        const decoded_noun& noun) const noexcept {
    return decide(requester, forwarder, asked, noun, false);
}

access_decision access_policy::sent(std::string_view forwarder, verb asked, const decoded_noun& noun) const noexcept {
    return decide(own_name_, forwarder, asked, noun, true);
}

bool access_policy::may_forward(std::string_view forwarder, std::string_view requester) const noexcept {
    const auto* const forwarding = find(forwarder);
    return forwarding != nullptr && find(requester) != nullptr &&
           (forwarder == requester || may_forward_for(forwarding->forwards, requester));
}

const access_policy::entry* access_policy::find(std::string_view name) const noexcept {
    const auto found = by_name_.find(name);
    return found == by_name_.end() ? nullptr : &entries_[found->second];
}

access_decision access_policy::decide(std::string_view requester, std::string_view forwarder, verb asked,
                                      const decoded_noun& noun, bool is_own) const noexcept {
    access_decision out;
    const auto denied = [&](cause by) {
        out.by = by;
        return out;
    };
    const auto* const asking = find(requester);
    const auto* const asked_of = find(noun.target());
    if (asking == nullptr) {
        return denied(cause::unknown_requester);
    }
    if (asked_of == nullptr) {
        return denied(cause::unknown_target);
    }
    if (!forwarder.empty() && find(forwarder) == nullptr) {
        return denied(cause::unknown_forwarder);
    }
    if (!forwarder.empty() && !may_forward(forwarder, requester)) {
        return denied(cause::not_forwarded);
    }
    if (is_exempt(noun)) {
        out.by = cause::exempt;
        return out;
    }
    if (rules_.denies_everything()) {
        return denied(cause::rules_unreadable);
    }
    out.rule = rules_.find(is_own ? std::string_view{} : requester, asked, noun);
    if (out.rule != nullptr && !out.rule->allows) {
        return denied(cause::rule);
    }
    out.may = asking->may.find(asked, noun);
    if (out.may == rights::nothing) {
        return denied(cause::may);
    }
    out.offers = asked_of->offers.find(asked, noun);
    return out.offers == rights::nothing ? denied(cause::offers) : out;
}

} // namespace cles::security
