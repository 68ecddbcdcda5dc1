// SPDX-License-Identifier: BSL-1.0
#include "frame_checks.hpp"

#include <cles/error.hpp>

#include "frame_codec.hpp"

#include <algorithm>
#include <utility>

namespace fmv {
namespace {

using cles::errc;
using cles::error;

constexpr int least_side = 64;
constexpr int most_side = 1024;
constexpr std::size_t most_pixels = 700'000; ///< of which the base64 and the rest fit into a line

bool is_within(double value, double low, double high) { return value >= low && value <= high; } // false for NaN

} // namespace

void require(bool fits, const char* what) {
    if (!fits) {
        throw error(errc::bad_request, what);
    }
}

void check_utc(double utc) { require(is_within(utc, 0, 1e11), "utc: seconds since 1970"); }

void check(const camera_message& from) {
    require(is_within(from.lat, -89, 89), "camera.lat: -89 to 89 degrees");
    require(is_within(from.lon, -180, 180), "camera.lon: -180 to 180 degrees");
    require(is_within(from.height, 1, 50'000), "camera.height: 1 to 50000 m above the ground");
    require(is_within(from.azimuth, -360, 360), "camera.azimuth: -360 to 360 degrees");
    require(is_within(from.depression, 10, 90), "camera.depression: 10 to 90 degrees below the horizon");
    require(is_within(from.field_of_view, 0.01, 120), "camera.field_of_view: 0.01 to 120 degrees");
    require(is_within(from.position_sigma, 0, 1000), "camera.position_sigma: 0 to 1000 m");
    require(is_within(from.pointing_sigma, 0, 10), "camera.pointing_sigma: 0 to 10 degrees");
}

extent checked_size(int width, int height, const std::string& format) {
    const extent size{.width = width, .height = height};
    if (std::min(width, height) < least_side || std::max(width, height) > most_side || size.pixels() > most_pixels) {
        throw error(errc::bad_request, "width and height: " + std::to_string(least_side) + " to " +
                                           std::to_string(most_side) + ", " + std::to_string(most_pixels) +
                                           " pixels at most");
    }
    require(format == "grey" || format == "jpeg", "format: grey or jpeg");
    require(format == "grey" || has_jpeg(),
            "format: this node is built without libjpeg-turbo, and takes only grey (recon --format grey)");
    return size;
}

grey decoded(const std::string& picture, extent size, const std::string& format) {
    auto pixels = decode(picture, size, format);
    if (!pixels) {
        throw error(errc::bad_request, format == "jpeg"
                                           ? "picture: not the base64 of a JPEG of " + std::to_string(size.width) +
                                                 " x " + std::to_string(size.height) + " pixels"
                                           : "picture: not the base64 of " + std::to_string(size.pixels()) + " bytes");
    }
    return std::move(*pixels);
}

} // namespace fmv
