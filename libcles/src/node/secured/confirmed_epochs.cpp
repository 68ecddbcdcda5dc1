// SPDX-License-Identifier: BSL-1.0
#include "node/secured/confirmed_epochs.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

bool confirmed_epochs::contain(std::string_view node, std::uint32_t epoch) const noexcept {
    const auto* const said = find(node);
    return said != nullptr && said->epoch == epoch;
}

const confirmed_epoch* confirmed_epochs::find(std::string_view node) const noexcept {
    const auto found = nodes_.find(node);
    return found != nodes_.end() && found->second.said ? &*found->second.said : nullptr;
}

void confirmed_epochs::confirm(std::string_view node, confirmed_epoch said, time_point now) {
    of(node, now).said = std::move(said);
}

time_point confirmed_epochs::next_question(std::string_view node) const noexcept {
    const auto found = nodes_.find(node);
    return found == nodes_.end() ? time_point::min() : found->second.next_question;
}

void confirmed_epochs::on_asked(std::string_view node, time_point now) { of(node, now).next_question = now + pause; }

confirmed_epochs::entry& confirmed_epochs::of(std::string_view node, time_point now) {
    auto at = nodes_.find(node);
    if (at == nodes_.end()) {
        if (nodes_.size() >= max_entries_ && !nodes_.empty()) {
            nodes_.erase(std::ranges::min_element(nodes_, {}, [](const auto& each) { return each.second.used; }));
        }
        at = nodes_.emplace(std::string{node}, entry{}).first;
    }
    at->second.used = now;
    return at->second;
}

} // namespace cles::core
