// SPDX-License-Identifier: BSL-1.0
#include "node/base/log_budget.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

std::optional<std::uint64_t> log_budget::take(std::string_view source, time_point now) {
    auto found = std::ranges::find(entries_, source, &entry::source);
    if (found == entries_.end()) {
        if (entries_.size() < max_sources) {
            entries_.push_back({std::string{source}, now + between});
            return 0;
        }
        found = std::ranges::min_element(entries_, {}, &entry::next);
        if (found->next > now) {
            return std::nullopt;
        }
        *found = {std::string{source}, now + between};
        return 0;
    }
    if (found->next > now) {
        if (found->taken < lines_) {
            ++found->taken;
            return 0;
        }
        ++found->left_out;
        return std::nullopt;
    }
    found->next = now + between;
    found->taken = 1;
    return std::exchange(found->left_out, 0);
}

} // namespace cles::core
