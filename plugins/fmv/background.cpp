// SPDX-License-Identifier: BSL-1.0
#include "background.hpp"

#include <algorithm>
#include <array>

namespace fmv {
namespace {

constexpr float pace = 1.0F / 16;
constexpr float slow_pace = 1.0F / 256;

} // namespace

background::background(extent size) : size_(size), shown_(size.pixels()) {}

void background::complete(grey& aligned, const grey& seen) {
    if (reference_.empty()) {
        reference_ = aligned;
    }
    for (std::size_t i = 0; i < aligned.size(); ++i) {
        if (seen[i] == 0) {
            aligned[i] = reference_[i];
        } else if (shown_[i] == 0) {
            shown_[i] = 1;
            reference_[i] = aligned[i];
            for (auto& frame : kept_) {
                frame[i] = aligned[i];
            }
            if (known()) {
                values_[i] = aligned[i];
            }
        }
    }
}

void background::learn(const grey& aligned) {
    if (seen_ == 0) {
        reference_ = aligned;
    }
    if (seen_ % apart == 0) {
        kept_.push_back(aligned);
    }
    if (++seen_ == learning) {
        take_medians();
        kept_ = {};
    }
}

void background::take_medians() {
    values_.resize(size_.pixels());
    std::array<std::uint8_t, samples> column{};
    for (std::size_t i = 0; i < values_.size(); ++i) {
        std::transform(kept_.begin(), kept_.end(), column.begin(), [i](const grey& frame) { return frame[i]; });
        std::nth_element(column.begin(), column.begin() + samples / 2, column.end());
        values_[i] = column[samples / 2];
        reference_[i] = column[samples / 2]; // less noise than one frame has
    }
}

void background::follow(const grey& aligned, const grey& moving) {
    for (std::size_t i = 0; i < values_.size(); ++i) {
        values_[i] += (static_cast<float>(aligned[i]) - values_[i]) * (moving[i] != 0 ? slow_pace : pace);
        // NOLINTNEXTLINE(bugprone-incorrect-roundings): never negative, and a call for each pixel would cost more
        reference_[i] = static_cast<std::uint8_t>(values_[i] + 0.5F);
    }
}

} // namespace fmv
