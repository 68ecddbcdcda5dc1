// SPDX-License-Identifier: BSL-1.0
#include "port/log_budget.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

// A new source takes the place of one whose time is over; null if there is none.
log_budget::entry* log_budget::find(const line& l, time_point now) {
    std::size_t of_kind = 0;
    entry* oldest = nullptr;
    for (auto& each : entries_) {
        if (each.kind != l.kind) {
            continue;
        }
        if (each.source == l.source) {
            return &each;
        }
        ++of_kind;
        if (oldest == nullptr || each.next < oldest->next) {
            oldest = &each;
        }
    }
    if (of_kind < max_sources) {
        return &entries_.emplace_back(entry{.kind = l.kind, .source = std::string{l.source}});
    }
    if (oldest->next > now) {
        return nullptr;
    }
    *oldest = entry{.kind = l.kind, .source = std::string{l.source}};
    return oldest;
}

std::optional<std::uint64_t> log_budget::take(const line& l, time_point now) {
    auto* const found = find(l, now);
    if (found == nullptr) {
        return std::nullopt;
    }
    std::uint64_t left_out = 0;
    if (found->taken == 0 || found->next <= now) {
        found->next = now + l.in;
        found->taken = 0;
        found->texts.clear();
        left_out = std::exchange(found->left_out, 0);
    }
    if (found->taken >= l.most || (!l.text.empty() && std::ranges::find(found->texts, l.text) != found->texts.end())) {
        ++found->left_out;
        return std::nullopt;
    }
    ++found->taken;
    if (!l.text.empty()) {
        found->texts.emplace_back(l.text);
    }
    return left_out;
}

std::string left_out_text(std::uint64_t lines) {
    return lines == 0 ? std::string{} : " (and " + std::to_string(lines) + " since the last such line)";
}

} // namespace cles::core
