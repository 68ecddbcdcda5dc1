// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image_set.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace digits {

/// How many values each layer of a network has.
struct shape {
    std::uint32_t inputs = 0, hidden = 0, classes = 0;

    [[nodiscard]] std::size_t weights() const noexcept {
        return hidden * (std::size_t{inputs} + 1) + classes * (std::size_t{hidden} + 1);
    }
    bool operator==(const shape&) const = default;
};

/// The most weights that a network may have: as text, they fit into a line of 1 MiB.
inline constexpr std::size_t most_weights = 190'000;
/// \throws std::invalid_argument unless each layer has a value, and there are not more than `most_weights`
void check(const shape& form);

/// A neural network with one hidden layer, rectified, which gives each class a score. The weights are, one after the
/// other: from each input to all hidden values, the hidden values' biases, from each hidden value to all classes, and
/// the classes' biases.
struct network {
    shape form{};
    std::vector<float> weights{};

    bool operator==(const network&) const = default;
};

/// Random weights, small enough that all values stay near 1; the biases are 0. The same seed gives the same weights.
/// \throws std::invalid_argument as `check`
network made(const shape& form, std::uint64_t seed);

bool is_finite(const network& n) noexcept;

/// What a network computes for an image. It keeps the values of the layers, so that nothing is allocated for the next
/// image.
class forward_pass {
  public:
    explicit forward_pass(const shape& form) : hidden_(form.hidden), scores_(form.classes) {}

    void run(const network& n, std::span<const float> image);
    /// Of the hidden layer, 0 or more.
    [[nodiscard]] std::span<const float> hidden() const noexcept { return hidden_; }
    /// One for each class.
    [[nodiscard]] std::span<const float> scores() const noexcept { return scores_; }

  private:
    std::vector<float> hidden_;
    std::vector<float> scores_;
};

/// The part of the images whose class has the highest score, 0 to 1.
double accuracy(const network& n, const image_set& images);

struct weighted_network {
    const network* of = nullptr; ///< all of one shape
    double weight = 0;           ///< more than 0
};
/// The mean, weight by weight. \param parts at least one
network average(const std::vector<weighted_network>& parts);

} // namespace digits
