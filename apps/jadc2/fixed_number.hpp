// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace jadc2 {

/// A number with that many digits after the decimal point.
std::string fixed(double number, int digits);

} // namespace jadc2
