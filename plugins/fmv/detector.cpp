// SPDX-License-Identifier: BSL-1.0
#include "detector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace fmv {
namespace {

constexpr double sigmas = 5;                   ///< of the noise, above which a difference is one
constexpr float of_the_slope = 0.35F;          ///< registration is off by half a pixel at most, and smoothed
constexpr int least_area = 8;                  ///< pixels
constexpr int most_area = 400;                 ///< more is a change of light or a lost registration
constexpr double deviation_of_median = 1.4826; ///< sigma / MAD of a normal distribution
constexpr double least_noise = 0.3;
constexpr int border = 6; ///< which not every frame shows
constexpr int bins_per_level = 16;

} // namespace

detector::detector(extent size)
    : size_(size), difference_(size.pixels()), rows_(size.pixels()), mask_(size.pixels()), moving_(size.pixels()) {}

const std::vector<detection>& detector::look(const grey& aligned, const std::vector<float>& background) {
    differ(aligned, background);
    estimate_noise();
    mark(background);
    gather();
    return found_;
}

// The mean of 3 x 3 pixels has a third of the noise, and targets are larger than that.
void detector::differ(const grey& aligned, const std::vector<float>& background) {
    for (int y = 0; y < size_.height; ++y) {
        for (int x = 1; x + 1 < size_.width; ++x) {
            const auto i = size_.at(x, y);
            float sum = 0;
            for (auto k = i - 1; k <= i + 1; ++k) {
                sum += static_cast<float>(aligned[k]) - background[k];
            }
            rows_[i] = sum;
        }
    }
    const auto row = static_cast<std::size_t>(size_.width);
    for (int y = 1; y + 1 < size_.height; ++y) {
        for (int x = 1; x + 1 < size_.width; ++x) {
            const auto i = size_.at(x, y);
            difference_[i] = (rows_[i - row] + rows_[i] + rows_[i + row]) / 9;
        }
    }
}

// The median of the absolute deviation: targets, which are a small part of all pixels, hardly move it.
void detector::estimate_noise() {
    std::array<std::size_t, 64 * bins_per_level> counts{};
    std::size_t all = 0;
    for (int y = border; y < size_.height - border; ++y) {
        for (int x = border; x < size_.width - border; ++x) {
            const auto bin = static_cast<std::size_t>(std::abs(difference_[size_.at(x, y)]) * bins_per_level);
            ++counts[std::min(bin, counts.size() - 1)];
            ++all;
        }
    }
    std::size_t below = 0;
    std::size_t bin = 0;
    while (bin + 1 < counts.size() && (below + counts[bin]) * 2 < all) {
        below += counts[bin++];
    }
    const double within = counts[bin] == 0 ? 0
                                           : (static_cast<double>(all) / 2 - static_cast<double>(below)) /
                                                 static_cast<double>(counts[bin]);
    noise_ = std::max(least_noise, (static_cast<double>(bin) + within) / bins_per_level * deviation_of_median);
}

void detector::mark(const std::vector<float>& background) {
    std::fill(mask_.begin(), mask_.end(), std::uint8_t{0});
    const auto row = static_cast<std::size_t>(size_.width);
    const auto least = static_cast<float>(sigmas * noise_);
    for (int y = border; y < size_.height - border; ++y) {
        for (int x = border; x < size_.width - border; ++x) {
            const auto i = size_.at(x, y);
            const auto d = std::abs(difference_[i]);
            if (d > least) { // few are: the slope need not be known elsewhere
                const auto slope = std::abs(background[i + 1] - background[i - 1]) +
                                   std::abs(background[i + row] - background[i - row]);
                mask_[i] = d > least + of_the_slope * slope / 2 ? 1 : 0;
            }
        }
    }
}

void detector::gather() {
    found_.clear();
    std::fill(moving_.begin(), moving_.end(), std::uint8_t{0});
    for (int y = border; y < size_.height - border; ++y) {
        for (int x = border; x < size_.width - border; ++x) {
            if (mask_[size_.at(x, y)] == 1) {
                if (const auto d = fill(x, y); d.area >= least_area && d.area <= most_area) {
                    found_.push_back(d);
                }
            }
        }
    }
}

// All that hangs together, over gaps of one pixel too, so that a target is not torn apart.
detection detector::fill(int x, int y) {
    detection d;
    double weight = 0;
    open_.assign(1, size_.at(x, y));
    mask_[open_.front()] = 2;
    while (!open_.empty()) {
        const auto i = open_.back();
        open_.pop_back();
        const int at_x = static_cast<int>(i % static_cast<std::size_t>(size_.width));
        const int at_y = static_cast<int>(i / static_cast<std::size_t>(size_.width));
        const double w = std::abs(difference_[i]);
        d.centre.x += w * at_x;
        d.centre.y += w * at_y;
        weight += w;
        ++d.area;
        for (int dy = -2; dy <= 2; ++dy) { // the border keeps it inside
            for (int dx = -2; dx <= 2; ++dx) {
                const auto next = size_.at(at_x + dx, at_y + dy);
                moving_[next] = 1;
                if (mask_[next] == 1) {
                    mask_[next] = 2;
                    open_.push_back(next);
                }
            }
        }
    }
    d.centre.x /= weight;
    d.centre.y /= weight;
    return d;
}

} // namespace fmv
