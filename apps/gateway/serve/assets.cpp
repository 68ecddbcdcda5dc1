// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/assets.hpp"

#include <algorithm>
#include <array>

namespace gateway {
namespace {

constexpr std::string_view front_page = R"(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>CLES gateway</title>
<h1>CLES gateway</h1>
<p>This gateway passes requests to the nodes of a CLES network:</p>
<ul>
<li><a href="/openapi.json">what these nodes offer</a>, as OpenAPI</li>
<li><a href="/pull/all/cles">the nodes themselves</a></li>
<li><a href="/metrics">their metrics</a></li>
</ul>
</html>
)";

// Add the files of a page here.
constexpr std::array assets{asset{"/", "text/html; charset=utf-8", front_page}};

} // namespace

const asset* find_asset(std::string_view path) noexcept {
    const auto* const found = std::ranges::find(assets, path, &asset::path);
    return found == assets.end() ? nullptr : found;
}

} // namespace gateway
