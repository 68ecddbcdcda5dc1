// SPDX-License-Identifier: BSL-1.0
#include "core/plain_nodes.hpp"

#include <algorithm>

namespace cles::core {

bool plain_nodes::add(const presence& others, std::string_view node, time_point until, time_point now) {
    const auto known = others.look(node);
    if (!known || !others.source_of(node)) {
        return false;
    }
    if (all_.size() >= others.most()) {
        std::erase_if(all_, [now](const auto& one) { return one.second.until <= now; });
    }
    if (all_.size() >= others.most()) {
        return false;
    }
    all_.insert_or_assign(std::string{node}, entry{known->epoch, until});
    return true;
}

bool plain_nodes::contain(const presence::known& k, time_point now) const {
    const auto found = all_.find(k.node);
    return found != all_.end() && found->second.epoch == k.epoch && found->second.until > now;
}

std::size_t plain_nodes::worth_asking(const presence& others, time_point now) const {
    const auto plain = std::count_if(all_.begin(), all_.end(), [&](const auto& one) {
        const auto known = others.look(one.first);
        return known && contain(*known, now);
    });
    return others.size() - static_cast<std::size_t>(plain);
}

} // namespace cles::core
