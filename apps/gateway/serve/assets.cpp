// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/assets.hpp"

#include <algorithm>
#include <array>

namespace gateway {
namespace {

using namespace std::string_view_literals;

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Woverlength-strings" // the standard requires 65,536 bytes, compilers take more

// The page of the gateway: apps/gateway/page, bundled.
constexpr std::array assets{
#include "assets.inc"
};

#pragma GCC diagnostic pop

} // namespace

const asset* find_asset(std::string_view path) noexcept {
    const auto* const found = std::ranges::find(assets, path, &asset::path);
    return found == assets.end() ? nullptr : found;
}

} // namespace gateway
