// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "digits/descent.hpp"
#include "digits/image_set.hpp"
#include "digits/network.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
} // namespace CLI

namespace dsgd {

/// The arguments of the commands that train in rounds, with a manager or among neighbours.
struct training_arguments {
    std::string test{}; ///< a file
    std::uint64_t rounds = 40, evaluate = 1;
    digits::schedule how{}; ///< of a round; the seed is that of the first
    std::uint32_t hidden = 64;
    std::optional<double> best{};
    bool json = false;

    /// \param seed_help says whose seed it is
    void add_options(CLI::App& command, const std::string& seed_help);
    /// The network with which the first round begins. \param images the kind that it is for
    [[nodiscard]] digits::network start(const digits::image_set& images) const;
};

} // namespace dsgd
