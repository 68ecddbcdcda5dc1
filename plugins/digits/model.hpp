// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "network.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>

namespace digits {

/// A network as nodes exchange it: its shape, and its weights as 32-bit floating-point numbers, the lowest byte first,
/// in base64. That is exact, and takes less than half of the bytes of decimal numbers.
struct model {
    std::uint32_t inputs = 0, hidden = 0, classes = 0;
    std::string weights{};
};
BOOST_DESCRIBE_STRUCT(model, (), (inputs, hidden, classes, weights))

model to_model(const network& n);

/// \throws std::invalid_argument if its shape is not possible, there are not as many weights, or one is not finite
network from_model(const model& m);

} // namespace digits
