// SPDX-License-Identifier: BSL-1.0
#include "scene.hpp"

#include "geo/normal.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace jadc2 {
namespace {

using sgd::random_source;

constexpr double degree = std::numbers::pi / 180;
// The aircraft's circle, and what its camera shows of the ground: half a metre per pixel.
constexpr double radius = 1000;       // m
constexpr double height = 1800;       // m
constexpr double speed = 40;          // m/s
constexpr double pixel = 0.25e-3;     // rad
constexpr double shake = 1.2 * pixel; // at most, in each direction
constexpr double cell = 0.5;          // m, of the texture
constexpr std::size_t table = 4096;   // normally distributed numbers
constexpr fmv::extent ground_size{.width = 480, .height = 480};

// A number for each node of a lattice, with smooth transitions between.
void add_lattice(std::vector<float>& ground, random_source& chance, int side, double amplitude) {
    const fmv::extent nodes{.width = ground_size.width / side + 2, .height = ground_size.height / side + 2};
    std::vector<double> heights(nodes.pixels());
    std::generate(heights.begin(), heights.end(), [&] { return chance.within_one() * amplitude; });
    const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
    for (int y = 0; y < ground_size.height; ++y) {
        for (int x = 0; x < ground_size.width; ++x) {
            const double u = smooth(x % side / static_cast<double>(side));
            const double v = smooth(y % side / static_cast<double>(side));
            const auto at = [&](int dx, int dy) { return heights[nodes.at(x / side + dx, y / side + dy)]; };
            const double top = std::lerp(at(0, 0), at(1, 0), u);
            const double bottom = std::lerp(at(0, 1), at(1, 1), u);
            ground[ground_size.at(x, y)] += static_cast<float>(std::lerp(top, bottom, v));
        }
    }
}

// Squares outside the texture are as its edge.
float brightness(const std::vector<float>& ground, geo::plane_position at) {
    const double x = std::clamp(ground_size.width / 2.0 + at.east / cell, 0.0, ground_size.width - 1.001);
    const double y = std::clamp(ground_size.height / 2.0 - at.north / cell, 0.0, ground_size.height - 1.001);
    const auto u = static_cast<float>(x - std::floor(x));
    const auto v = static_cast<float>(y - std::floor(y));
    return fmv::between_pixels(ground, ground_size, ground_size.at(static_cast<int>(x), static_cast<int>(y)), u, v);
}

} // namespace

const geo::tangent_plane& scene::plane() {
    static const geo::tangent_plane one{geo::traffic::origin};
    return one;
}

scene::scene(std::uint64_t seed) : seed_(seed), traffic_(seed), ground_(ground_size.pixels(), 110.0F), normal_(table) {
    make_ground();
    random_source chance{seed * 4 + 2};
    std::generate(normal_.begin(), normal_.end(), [&] { return static_cast<float>(geo::normal(chance) * noise); });
    phase_ = chance.within_one() * std::numbers::pi;
    error_east_ = geo::normal(chance) * position_sigma;
    error_north_ = geo::normal(chance) * position_sigma;
    error_azimuth_ = geo::normal(chance) * pointing_sigma * degree;
    error_depression_ = geo::normal(chance) * pointing_sigma * degree;
}

void scene::make_ground() {
    random_source chance{seed_ * 4};
    add_lattice(ground_, chance, 64, 25);
    add_lattice(ground_, chance, 24, 14);
    add_lattice(ground_, chance, 10, 6);
    for (int roofs = 0; roofs < 24; ++roofs) {
        const auto left = static_cast<int>(chance.below(static_cast<std::uint32_t>(ground_size.width - 40)));
        const auto top = static_cast<int>(chance.below(static_cast<std::uint32_t>(ground_size.height - 40)));
        const auto right = left + 12 + static_cast<int>(chance.below(28));
        const auto bottom = top + 12 + static_cast<int>(chance.below(28));
        const auto shade = static_cast<float>(chance.within_one() * 40);
        for (int y = top; y < bottom; ++y) {
            for (int x = left; x < right; ++x) {
                ground_[ground_size.at(x, y)] += shade;
            }
        }
    }
}

geo::camera scene::nominal(double utc) const {
    const double turn = std::fmod(speed / radius * utc, 2 * std::numbers::pi) + phase_;
    return {.at = {.east = radius * std::sin(turn), .north = radius * std::cos(turn)},
            .height = height,
            .azimuth = std::remainder(turn + std::numbers::pi, 2 * std::numbers::pi),
            .depression = std::atan2(height, radius),
            .focal_length = 1 / pixel,
            .centre_x = size.width / 2.0,
            .centre_y = size.height / 2.0};
}

geo::camera scene::camera(std::uint64_t number, double utc) const {
    auto out = nominal(utc);
    random_source chance{seed_ * 1'000'003 + number};
    out.azimuth += chance.within_one() * shake / std::cos(out.depression);
    out.depression += chance.within_one() * shake;
    return out;
}

fmv::camera_message scene::reported(double utc) const {
    const auto truth = nominal(utc);
    const auto at =
        plane().to_geographic({.east = truth.at.east + error_east_, .north = truth.at.north + error_north_});
    return {.lat = at.lat,
            .lon = at.lon,
            .height = truth.height,
            .azimuth = (truth.azimuth + error_azimuth_ / std::cos(truth.depression)) / degree,
            .depression = (truth.depression + error_depression_) / degree,
            .field_of_view = 2 * std::atan2(size.width / 2.0, truth.focal_length) / degree,
            .position_sigma = position_sigma,
            .pointing_sigma = pointing_sigma};
}

// An ellipse along its road, with an edge that is one pixel wide.
void scene::draw(std::size_t vehicle, geo::plane_position at, const geo::projection& view,
                 std::vector<float>& onto) const {
    const auto& what = traffic_.vehicles()[vehicle];
    const auto along = traffic_.along();
    const auto middle = view.to_image(at);
    if (!middle) {
        return;
    }
    constexpr int reach = 9; // pixels
    const int left = std::max(0, static_cast<int>(middle->x) - reach);
    const int top = std::max(0, static_cast<int>(middle->y) - reach);
    for (int y = top; y <= std::min(size.height - 1, static_cast<int>(middle->y) + reach); ++y) {
        for (int x = left; x <= std::min(size.width - 1, static_cast<int>(middle->x) + reach); ++x) {
            const auto place = view.to_ground({.x = static_cast<double>(x), .y = static_cast<double>(y)});
            if (!place) {
                continue;
            }
            const double east = place->east - at.east;
            const double north = place->north - at.north;
            const double forth = (east * along.east + north * along.north) / what.half_length;
            const double aside = (east * along.north - north * along.east) / what.half_width;
            const double inside = (1 - std::hypot(forth, aside)) * what.half_width / cell + 0.5;
            onto[size.at(x, y)] += static_cast<float>(std::clamp(inside, 0.0, 1.0) * what.contrast);
        }
    }
}

fmv::grey scene::frame(std::uint64_t number, double utc) const {
    const geo::projection view{camera(number, utc)};
    std::vector<float> light(size.pixels());
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            const auto place = view.to_ground({.x = static_cast<double>(x), .y = static_cast<double>(y)});
            light[size.at(x, y)] = place ? brightness(ground_, *place) : 0;
        }
    }
    const auto vehicles = truth(utc);
    for (std::size_t i = 0; i < vehicles.size(); ++i) {
        draw(i, vehicles[i].at, view, light);
    }
    random_source chance{seed_ * 7'000'003 + number};
    fmv::grey pixels(size.pixels());
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        bits = i % 5 == 0 ? chance.next() : bits >> 12U;
        pixels[i] = static_cast<std::uint8_t>(std::clamp(light[i] + normal_[bits % table] + 0.5F, 0.0F, 255.0F));
    }
    return pixels;
}

} // namespace jadc2
