// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "network.hpp"
#include "sgd/random_source.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace digits {

/// How a network is trained.
struct schedule {
    std::uint64_t passes = 1; ///< over all images
    double rate = 0.1;        ///< the size of a step
    std::uint64_t seed = 1;   ///< of the order of the images
};

inline constexpr const char* diverged = "it does not converge: the rate is too large";

/// Stochastic gradient descent on the cross entropy of the classes, in one thread: each pass takes the images in a
/// random order, and each image moves the weights against the gradient there. It goes on in stretches, so that it can
/// report progress, and be cancelled. The same images, network and schedule give the same bits on machines with the
/// same mathematical library.
class descent {
  public:
    /// \param images outlive it, and are of the network's shape
    descent(const image_set& images, network start, const schedule& how);

    /// Does another stretch; false if nothing is left.
    bool step();
    /// From 0 to 1.
    [[nodiscard]] double part_done() const noexcept;
    [[nodiscard]] std::uint64_t steps() const noexcept { return done_; }
    /// The mean cross entropy of the images, each just before its step.
    [[nodiscard]] double mean_loss() const noexcept;
    /// Whether the rate was too large: weights are not finite, or the loss is far above that of a guess.
    [[nodiscard]] bool diverged() const noexcept;
    [[nodiscard]] const network& result() const noexcept { return now_; }

  private:
    static constexpr std::uint64_t stretch = 128; // takes less than a millisecond for small images

    void learn(std::size_t image);

    const image_set& images_;
    schedule how_;
    sgd::random_source chance_;
    network now_;
    forward_pass pass_;
    std::vector<std::uint32_t> order_;
    std::vector<float> slopes_; ///< of the loss, by the scores
    std::vector<float> back_;   ///< by the hidden values
    std::uint64_t all_;
    std::uint64_t done_ = 0;
    double loss_ = 0;
};

} // namespace digits
