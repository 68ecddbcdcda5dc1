// SPDX-License-Identifier: BSL-1.0
#include "training_arguments.hpp"

#include "dsgd/check_arguments.hpp"

#include <CLI/CLI.hpp>

namespace dsgd {

void training_arguments::add_options(CLI::App& command, const std::string& seed_help) {
    command.add_option("--test", test, "A file of images with which the accuracy is measured")
        ->type_name("FILE")
        ->required();
    command.add_option("--rounds", rounds, "Number of rounds (40)")->check(CLI::Range(1, 1'000'000));
    command.add_option("--passes", how.passes, "Passes of a node over its images in a round (1)")
        ->check(CLI::Range(1, 10'000));
    command.add_option("--hidden", hidden, "Values in the network's hidden layer (64)")->check(CLI::Range(1, 100'000));
    command.add_option("--rate", how.rate, "Size of a step (0.1)")->check(wrong_rate);
    command.add_option("--seed", how.seed, seed_help)->check(CLI::NonNegativeNumber);
    command
        .add_option("--evaluate", evaluate,
                    "Measure the accuracy after every so many rounds (1); 0: only after the last one")
        ->check(CLI::NonNegativeNumber);
    command.add_option("--best", best, "The best accuracy that is known, 0 to 1 (what the test file says)")
        ->check(CLI::Range(0.0, 1.0));
    command.add_flag("--json", json, "Print a JSON object instead of lines");
}

digits::network training_arguments::start(const digits::image_set& images) const {
    return digits::made({.inputs = images.header().pixels, .hidden = hidden, .classes = images.header().classes},
                        how.seed);
}

} // namespace dsgd
