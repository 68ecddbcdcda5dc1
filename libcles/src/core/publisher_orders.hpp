// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/update_order.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

/// The order of a noun's updates, of each publisher apart. Where there are more publishers than are told apart, the one
/// that has been silent for longest is forgotten.
class publisher_orders {
  public:
    explicit publisher_orders(std::size_t most) noexcept : most_(most) {}

    /// Of an update that has come from there.
    update_order& of(std::string_view publisher) {
        auto at = sources_.find(publisher);
        if (at == sources_.end()) {
            if (sources_.size() >= most_) {
                sources_.erase(std::min_element(sources_.begin(), sources_.end(), [](const auto& a, const auto& b) {
                    return a.second.heard < b.second.heard;
                }));
            }
            at = sources_.emplace(std::string{publisher}, source{}).first;
        }
        at->second.heard = ++heard_;
        return at->second.order;
    }
    void forget(std::string_view publisher) {
        if (const auto at = sources_.find(publisher); at != sources_.end()) {
            sources_.erase(at);
        }
    }
    [[nodiscard]] std::size_t size() const noexcept { return sources_.size(); }

  private:
    struct source {
        update_order order;
        std::uint64_t heard = 0; // when, counted in updates
    };

    std::size_t most_;
    std::map<std::string, source, std::less<>> sources_;
    std::uint64_t heard_ = 0;
};

} // namespace cles::core
