// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "convergence.hpp"
#include "digits/image_set.hpp"
#include "digits/network.hpp"
#include "round_plan.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace dsgd {

/// The accuracy after a round.
struct evaluation {
    std::uint64_t round = 0;
    double accuracy = 0;
    double after_ms = 0; ///< since the beginning; in one thread, without the time of evaluations
};
BOOST_DESCRIBE_STRUCT(evaluation, (), (round, accuracy, after_ms))

/// What is printed of a training, as JSON.
struct training_results {
    std::string error{};
    std::string shortcoming{}; ///< of the result; empty if it is good
    double accuracy = 0;
    std::optional<double> best_accuracy{}; ///< the best that is known
    std::uint64_t rounds = 0;              ///< that have ended
    std::uint64_t images = 0;              ///< that were trained on, each as often as it was
    double elapsed_ms = 0;
    double images_per_s = 0;
    double bytes_per_round = 0; ///< of the networks that this program sends and receives, as text
    std::vector<evaluation> accuracies{};
    std::vector<round_result> course{};
};
BOOST_DESCRIBE_STRUCT(training_results, (),
                      (error, shortcoming, accuracy, best_accuracy, rounds, images, elapsed_ms, images_per_s,
                       bytes_per_round, accuracies, course))

/// Follows a training: evaluates, prints, and decides the exit code.
class training_report {
  public:
    /// \param test   outlives it
    /// \param rounds that are planned
    /// \param every  so many rounds the accuracy is measured; 0: after the last one
    /// \param best   the best accuracy that is known; none: that of the file
    training_report(const digits::image_set& test, std::uint64_t rounds, std::uint64_t every,
                    std::optional<double> best, bool json);

    /// A round has ended with this network.
    void add(const round_result& ended, const digits::network& n);
    /// Prints the result, and returns the exit code. \param bytes sent and received in all rounds
    int finish(const std::optional<cles::error>& failure, std::uint64_t bytes);

  private:
    const digits::image_set& test_;
    std::uint64_t rounds_, every_;
    bool json_;
    convergence accuracies_{};
    training_results found_{};
};

} // namespace dsgd
