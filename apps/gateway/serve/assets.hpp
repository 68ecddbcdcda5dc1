// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace gateway {

/// A file of the page that the gateway serves, which is a part of the program.
struct asset {
    std::string_view path; ///< as it is requested
    std::string_view type;
    std::string_view content;
};

/// The asset at this path; null if there is none.
const asset* find_asset(std::string_view path) noexcept;

} // namespace gateway
