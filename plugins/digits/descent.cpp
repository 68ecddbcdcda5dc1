// SPDX-License-Identifier: BSL-1.0
#include "descent.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace digits {

descent::descent(const image_set& images, network start, const schedule& how)
    : images_(images), how_(how), chance_(how.seed), now_(std::move(start)), pass_(now_.form), order_(images.size()),
      slopes_(now_.form.classes), back_(now_.form.hidden), all_(how.passes * images.size()) {
    std::iota(order_.begin(), order_.end(), std::uint32_t{0});
}

bool descent::step() {
    const auto until = std::min(all_, done_ + stretch);
    for (; done_ < until; ++done_) {
        const auto place = static_cast<std::uint32_t>(done_ % order_.size());
        const auto left = static_cast<std::uint32_t>(order_.size()) - place;
        std::swap(order_[place], order_[place + chance_.below(left)]);
        learn(order_[place]);
    }
    return done_ < all_;
}

void descent::learn(std::size_t image) {
    const auto [inputs, hidden, classes] = now_.form;
    const auto pixels = images_.image(image);
    pass_.run(now_, pixels);
    const auto scores = pass_.scores();
    const auto values = pass_.hidden();
    const auto right = images_.class_of(image);
    const auto highest = *std::max_element(scores.begin(), scores.end());
    float sum = 0;
    for (std::uint32_t c = 0; c < classes; ++c) {
        slopes_[c] = std::exp(scores[c] - highest);
        sum += slopes_[c];
    }
    loss_ += static_cast<double>(std::log(sum) + highest - scores[right]);
    const auto rate = static_cast<float>(how_.rate);
    for (std::uint32_t c = 0; c < classes; ++c) {
        slopes_[c] = rate * (slopes_[c] / sum - (c == right ? 1.0F : 0.0F));
    }
    float* const from_inputs = now_.weights.data();
    float* const hidden_biases = from_inputs + std::size_t{inputs} * hidden;
    float* const from_hidden = hidden_biases + hidden;
    float* const class_biases = from_hidden + std::size_t{hidden} * classes;
    for (std::uint32_t k = 0; k < hidden; ++k) {
        float* const weights = from_hidden + std::size_t{k} * classes;
        const auto value = values[k];
        float slope = 0;
        if (value > 0) { // otherwise it changes nothing
            for (std::uint32_t c = 0; c < classes; ++c) {
                slope += slopes_[c] * weights[c];
                weights[c] -= value * slopes_[c];
            }
        }
        back_[k] = slope;
    }
    for (std::uint32_t c = 0; c < classes; ++c) {
        class_biases[c] -= slopes_[c];
    }
    for (std::uint32_t k = 0; k < hidden; ++k) {
        hidden_biases[k] -= back_[k];
    }
    for (std::uint32_t i = 0; i < inputs; ++i) {
        const auto pixel = pixels[i];
        if (pixel == 0) {
            continue;
        }
        float* const weights = from_inputs + std::size_t{i} * hidden;
        for (std::uint32_t k = 0; k < hidden; ++k) {
            weights[k] -= pixel * back_[k];
        }
    }
}

double descent::part_done() const noexcept {
    return all_ == 0 ? 1 : static_cast<double>(done_) / static_cast<double>(all_);
}

bool descent::diverged() const noexcept {
    const auto of_a_guess = std::log(static_cast<double>(now_.form.classes));
    return !is_finite(now_) || !(mean_loss() <= 10 * of_a_guess);
}

double descent::mean_loss() const noexcept { return done_ == 0 ? 0 : loss_ / static_cast<double>(done_); }

} // namespace digits
