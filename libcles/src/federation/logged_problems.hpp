// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <string>
#include <string_view>

namespace cles::bridging {

/// The problems that were logged, so that each is logged once, even if several take turns.
class logged_problems {
  public:
    static constexpr std::size_t most = 32; ///< when more occur, they are logged again

    /// Returns whether it is to be logged.
    bool add(std::string_view text) {
        if (texts_.contains(text)) {
            return false;
        }
        if (texts_.size() >= most) {
            texts_.clear();
        }
        texts_.emplace(text);
        return true;
    }
    void clear() noexcept { texts_.clear(); }

  private:
    std::set<std::string, std::less<>> texts_;
};

} // namespace cles::bridging
