// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/unordered/unordered_flat_map.hpp>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace cles::core {

/// Finds what belongs to a run of a node by its epoch. Two runs may have the same, by chance or by a bad source of it:
/// such an epoch tells nothing.
template <class T>
class run_index {
  public:
    void add(std::uint32_t epoch, T* what) {
        if (!first_.emplace(epoch, what).second) {
            further_.emplace_back(epoch, what);
        }
    }
    void remove(std::uint32_t epoch, T* what) {
        const auto further = std::find(further_.begin(), further_.end(), std::pair{epoch, what});
        if (further != further_.end()) {
            further_.erase(further);
            return;
        }
        const auto found = first_.find(epoch);
        if (found == first_.end() || found->second != what) {
            return;
        }
        const auto next =
            std::find_if(further_.begin(), further_.end(), [epoch](const auto& f) { return f.first == epoch; });
        if (next == further_.end()) {
            first_.erase(found);
        } else {
            found->second = next->second;
            further_.erase(next);
        }
    }
    /// Null where there is none, or more than one.
    [[nodiscard]] T* find(std::uint32_t epoch) const noexcept {
        const auto found = first_.find(epoch);
        return found == first_.end() || is_shared(epoch) ? nullptr : found->second;
    }
    [[nodiscard]] bool contains(std::uint32_t epoch) const noexcept { return first_.contains(epoch); }
    [[nodiscard]] bool is_shared(std::uint32_t epoch) const noexcept {
        return std::any_of(further_.begin(), further_.end(), [epoch](const auto& f) { return f.first == epoch; });
    }

  private:
    boost::unordered_flat_map<std::uint32_t, T*> first_;
    std::vector<std::pair<std::uint32_t, T*>> further_;
};

} // namespace cles::core
