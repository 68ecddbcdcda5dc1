// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>

namespace cles::bridging {

/// Which updates of a noun have been published: each arrives once for each requester, and is published once.
class published_updates {
  public:
    /// Whether the update is new, and counts as published from now on. Updates that are older than the last one, or of
    /// an earlier epoch, are not: readers drop them (docs/protocol.md, "Updates").
    [[nodiscard]] bool add(std::uint32_t epoch, std::uint64_t seq) noexcept {
        if (any_ && epoch == epoch_) {
            const bool is_new = seq > seq_;
            seq_ = std::max(seq_, seq);
            return is_new;
        }
        const auto end = before_.begin() + known_;
        if (std::find(before_.begin(), end, epoch) != end) {
            return false;
        }
        if (any_) {
            std::rotate(before_.begin(), before_.end() - 1, before_.end());
            before_.front() = epoch_;
            known_ = std::min(known_ + 1, std::ssize(before_));
        }
        any_ = true;
        epoch_ = epoch;
        seq_ = seq;
        return true;
    }

  private:
    std::array<std::uint32_t, 4> before_{}; // the epochs before, the last one first
    std::ptrdiff_t known_ = 0;              // of these
    std::uint32_t epoch_ = 0;
    std::uint64_t seq_ = 0;
    bool any_ = false;
};

} // namespace cles::bridging
