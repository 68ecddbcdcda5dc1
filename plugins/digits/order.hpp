// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "model.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace digits {

/// The answer to PULL digits: what kind of images a node has, and how many. The images themselves stay there.
struct offer {
    std::uint64_t images = 0;
    std::uint32_t pixels = 0;
    std::uint32_t classes = 0;
};
BOOST_DESCRIBE_STRUCT(offer, (), (images, pixels, classes))

/// The body of DELEGATE digits/train: which network, and how it is to be trained on the node's images.
struct order {
    model start{};
    std::optional<std::uint64_t> passes{}; ///< 1 unless set
    std::optional<double> rate{};          ///< 0.1 unless set
    std::optional<std::uint64_t> seed{};   ///< of the order of the images; 1 unless set
};
BOOST_DESCRIBE_STRUCT(order, (), (start, passes, rate, seed))

/// Its answer.
struct trained {
    std::string node{}; ///< that did it
    model result{};
    std::uint64_t images = 0;
    std::uint64_t steps = 0;
    double loss = 0; ///< the mean cross entropy during the training
    double ms = 0;   ///< that the descent itself took, by the node's own clock
};
BOOST_DESCRIBE_STRUCT(trained, (), (node, result, images, steps, loss, ms))

} // namespace digits
