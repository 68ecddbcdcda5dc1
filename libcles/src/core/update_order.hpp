// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace cles::core {

/// Tells, from `seq` and `epoch`, which updates of a noun are news to a binder and how many it has missed.
class update_order {
  public:
    struct verdict {
        bool news = false;        ///< false: old or repeated
        bool restarted = false;   ///< the publisher is another run than before
        std::uint64_t missed = 0; ///< updates between the last one and this
    };

    verdict take(std::uint32_t epoch, std::uint64_t seq) noexcept {
        if (epoch_ == epoch) {
            if (seq <= seq_) {
                return {};
            }
            const auto missed = seq - seq_ - 1;
            seq_ = seq;
            return {.news = true, .missed = missed};
        }
        if (std::find(left_.begin(), left_.end(), std::optional{epoch}) != left_.end()) {
            return {};
        }
        const bool restarted = epoch_.has_value();
        if (restarted) {
            left_[next_left_++ % left_.size()] = epoch_;
        }
        epoch_ = epoch;
        seq_ = seq;
        return {.news = true, .restarted = restarted};
    }

  private:
    std::optional<std::uint32_t> epoch_;
    std::uint64_t seq_ = 0;
    std::array<std::optional<std::uint32_t>, 4> left_{};
    std::size_t next_left_ = 0;
};

} // namespace cles::core
