// SPDX-License-Identifier: BSL-1.0
#include "core/seeds.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void seeds::set(const std::vector<std::string>& urls) {
    std::vector<seed> now;
    for (const auto& url : urls) {
        const auto same = [&url](const seed& s) { return s.url == url; };
        const auto known = std::find_if(all_.begin(), all_.end(), same);
        if (std::none_of(now.begin(), now.end(), same)) {
            now.push_back(known == all_.end() ? seed{.url = url} : std::move(*known));
        }
    }
    all_ = std::move(now);
}

std::optional<std::string> seeds::due(const presence& others, time_point now, std::chrono::milliseconds rest) {
    for (auto& s : all_) {
        if (s.self || s.next > now) {
            continue;
        }
        const auto known = s.node.empty() ? std::nullopt : others.look(s.node);
        if (known && !known->suspect) {
            s.pause = first_pause;
            s.next = now + rest;
            continue;
        }
        s.next = now + s.pause - jitter_.quarter_of(s.pause);
        s.pause = std::min(s.pause * 2, rest);
        return s.url;
    }
    return {};
}

std::optional<time_point> seeds::next() const noexcept {
    std::optional<time_point> soonest;
    for (const auto& s : all_) {
        if (!s.self && (!soonest || s.next < *soonest)) {
            soonest = s.next;
        }
    }
    return soonest;
}

void seeds::on_answer(std::string_view url, std::string_view node) {
    for (auto& s : all_) {
        if (s.url == url) {
            s.node = node;
        }
    }
}

void seeds::on_self(std::string_view url) {
    for (auto& s : all_) {
        s.self |= s.url == url;
    }
}

} // namespace cles::core
