// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/slot_grants.hpp"

#include <algorithm>

namespace cles::core {

std::uint64_t slot_grants::open(std::string_view to, std::uint64_t number, unsigned slots, time_point now) {
    auto& given = grants_[std::string{to}];
    if (now >= given.expires) {
        given = {.number = number, .previous = given.number};
    }
    given.slots = std::min(given.slots + slots, given.used + max_slots);
    given.expires = now + valid_for;
    return given.number;
}

void slot_grants::reserve(std::string_view to, unsigned slots, time_point until, time_point now) {
    if (const auto found = grants_.find(to); found != grants_.end() && slots != 0) {
        auto& all = found->second.reserved;
        std::erase_if(all, [now](const reservation& each) { return each.until <= now; });
        all.push_back({.until = until, .slots = slots});
    }
}

// The oldest first, since their jobs should have come by now.
void slot_grants::grant::unreserve(unsigned count) {
    for (auto& each : reserved) {
        const auto ended = std::min(count, each.slots);
        each.slots -= ended;
        count -= ended;
    }
    std::erase_if(reserved, [](const reservation& each) { return each.slots == 0; });
}

void slot_grants::unreserve(std::string_view by, std::uint64_t number, unsigned slots) {
    const auto found = grants_.find(by);
    if (found != grants_.end() && found->second.number == number) {
        found->second.unreserve(slots);
    }
}

void slot_grants::arrived(std::string_view by, std::uint64_t number, time_point now) {
    if (const auto found = grants_.find(by); found != grants_.end() && found->second.number == number) {
        auto& all = found->second.reserved;
        std::erase_if(all, [now](const reservation& each) { return each.until <= now; });
        found->second.unreserve(1);
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
        for (const auto& each : given.reserved) {
            all += now < each.until ? each.slots : 0;
        }
    }
    return all;
}

std::optional<time_point> slot_grants::next_expiry(time_point now) const {
    std::optional<time_point> next;
    for (const auto& [node, given] : grants_) {
        for (const auto& each : given.reserved) {
            if (now < each.until && (!next || each.until < *next)) {
                next = each.until;
            }
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
