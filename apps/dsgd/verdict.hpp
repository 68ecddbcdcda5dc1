// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "sgd/classifier.hpp"

#include <string>

namespace dsgd {

/// How much worse than the best known a result may be.
inline constexpr double tolerated = 0.01;
/// The exit code for a result that is worse, or has not converged.
inline constexpr int not_good = 7;

/// What is wrong with the result of a descent, for people; empty if its error is at most `tolerated` above the least
/// that is possible.
std::string shortcoming(const sgd::quality& found);

} // namespace dsgd
