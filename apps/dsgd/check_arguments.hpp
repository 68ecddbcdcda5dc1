// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace dsgd {

/// For people what is wrong with a URL, or with the size of a step; empty if nothing is.
std::string wrong_url(const std::string& text);
std::string wrong_rate(const std::string& text);

} // namespace dsgd
