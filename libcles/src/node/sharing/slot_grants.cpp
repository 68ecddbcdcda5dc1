// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/slot_grants.hpp"

#include <algorithm>

namespace cles::core {

std::uint64_t slot_grants::open(std::string_view to, std::uint64_t number, unsigned slots, unsigned reserved,
                                time_point now) {
    auto& given = grants_[std::string{to}];
    if (now >= given.expires) {
        given = {.number = number, .previous = given.number};
    }
    given.slots = std::min(given.slots + slots, given.used + max_slots);
    given.reserved += reserved;
    given.expires = now + valid_for;
    return given.number;
}

void slot_grants::unreserve(std::string_view by, std::uint64_t number, unsigned slots) {
    const auto found = grants_.find(by);
    if (found != grants_.end() && found->second.number == number) {
        auto& given = found->second;
        given.reserved -= std::min(slots, given.reserved);
    }
}

slot_grants::verdict slot_grants::check(std::string_view by, std::uint64_t number, time_point now) const {
    const auto found = grants_.find(by);
    if (found == grants_.end()) {
        return verdict::unknown;
    }
    const auto& given = found->second;
    if (given.number == number) {
        return now < given.expires && given.used < given.slots ? verdict::valid : verdict::over;
    }
    return given.previous == number ? verdict::over : verdict::unknown;
}

void slot_grants::use(std::string_view by) {
    if (const auto found = grants_.find(by); found != grants_.end() && found->second.used < found->second.slots) {
        ++found->second.used;
    }
}

unsigned slot_grants::reserved(time_point now) const {
    unsigned all = 0;
    for (const auto& [node, given] : grants_) {
        all += given.left(now);
    }
    return all;
}

unsigned slot_grants::reserved_for(std::string_view node, time_point now) const {
    const auto found = grants_.find(node);
    return found != grants_.end() ? found->second.left(now) : 0;
}

std::optional<time_point> slot_grants::next_expiry(time_point now) const {
    std::optional<time_point> next;
    for (const auto& [node, given] : grants_) {
        if (given.left(now) != 0 && (!next || given.expires < *next)) {
            next = given.expires;
        }
    }
    return next;
}

void slot_grants::forget(std::string_view node) {
    if (const auto found = grants_.find(node); found != grants_.end()) {
        grants_.erase(found);
    }
}

} // namespace cles::core
