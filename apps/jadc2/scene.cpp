// SPDX-License-Identifier: BSL-1.0
#include "scene.hpp"

#include "sgd/random_source.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace jadc2 {
namespace {

using fmv::point;
using sgd::random_source;

constexpr int margin = 4;
constexpr double shake = 1.5;       ///< pixels that the camera moves at most
constexpr double kept_inside = 16;  ///< pixels from the frame's edge, where vehicles turn back
constexpr std::size_t table = 4096; ///< normally distributed numbers
constexpr fmv::extent ground_size{.width = scene::size.width + 2 * margin, .height = scene::size.height + 2 * margin};

double between(random_source& chance, double low, double high) {
    return low + (chance.within_one() + 1) / 2 * (high - low);
}

// A number for each node of a lattice, with smooth transitions between.
void add_lattice(std::vector<float>& ground, random_source& chance, int cell, double amplitude) {
    const fmv::extent nodes{.width = ground_size.width / cell + 2, .height = ground_size.height / cell + 2};
    std::vector<double> heights(nodes.pixels());
    std::generate(heights.begin(), heights.end(), [&] { return chance.within_one() * amplitude; });
    const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
    for (int y = 0; y < ground_size.height; ++y) {
        for (int x = 0; x < ground_size.width; ++x) {
            const double u = smooth(x % cell / static_cast<double>(cell));
            const double v = smooth(y % cell / static_cast<double>(cell));
            const auto height = [&](int dx, int dy) { return heights[nodes.at(x / cell + dx, y / cell + dy)]; };
            const double top = std::lerp(height(0, 0), height(1, 0), u);
            const double bottom = std::lerp(height(0, 1), height(1, 1), u);
            ground[ground_size.at(x, y)] += static_cast<float>(std::lerp(top, bottom, v));
        }
    }
}

// From `low` to `high` and back again.
double between_walls(double x, double low, double high) {
    const double span = high - low;
    const double within = std::fmod(std::fmod(x - low, 2 * span) + 2 * span, 2 * span);
    return low + (within < span ? within : 2 * span - within);
}

} // namespace

scene::scene(std::uint64_t seed) : seed_(seed), ground_(ground_size.pixels(), 110.0F), normal_(table) {
    make_ground();
    make_vehicles();
    random_source chance{seed * 4 + 2};
    for (auto& value : normal_) { // Box and Muller
        const double u = between(chance, 1e-12, 1);
        value =
            static_cast<float>(std::sqrt(-2 * std::log(u)) * std::cos(std::numbers::pi * chance.within_one()) * noise);
    }
}

void scene::make_ground() {
    random_source chance{seed_ * 4};
    add_lattice(ground_, chance, 64, 25);
    add_lattice(ground_, chance, 24, 14);
    add_lattice(ground_, chance, 10, 6);
    for (int roofs = 0; roofs < 8; ++roofs) {
        const auto left = static_cast<int>(chance.below(static_cast<std::uint32_t>(size.width - 40)));
        const auto top = static_cast<int>(chance.below(static_cast<std::uint32_t>(size.height - 40)));
        const auto right = left + 12 + static_cast<int>(chance.below(28));
        const auto bottom = top + 12 + static_cast<int>(chance.below(28));
        const auto brightness = static_cast<float>(chance.within_one() * 40);
        for (int y = top; y < bottom; ++y) {
            for (int x = left; x < right; ++x) {
                ground_[ground_size.at(x, y)] += brightness;
            }
        }
    }
}

void scene::make_vehicles() {
    random_source chance{seed_ * 4 + 1};
    vehicles_.resize(3 + chance.below(3));
    for (auto& v : vehicles_) {
        const double speed = between(chance, 0.8, 2.5);
        const double heading = chance.within_one() * std::numbers::pi;
        v.start = {between(chance, kept_inside, size.width - kept_inside),
                   between(chance, kept_inside, size.height - kept_inside)};
        v.velocity = {speed * std::cos(heading), speed * std::sin(heading)};
        v.half_length = between(chance, 3.5, 5.5);
        v.half_width = between(chance, 2.5, 4);
        v.contrast = between(chance, 30, 50) * (chance.below(2) == 0 ? -1 : 1);
    }
}

point scene::camera(std::uint64_t number) const {
    random_source chance{seed_ * 1'000'003 + number};
    const double x = chance.within_one() * shake;
    const double y = chance.within_one() * shake;
    return {x, y};
}

std::vector<point> scene::truth(double time) const {
    std::vector<point> out;
    for (const auto& v : vehicles_) {
        out.push_back({between_walls(v.start.x + v.velocity.x * time, kept_inside, size.width - kept_inside),
                       between_walls(v.start.y + v.velocity.y * time, kept_inside, size.height - kept_inside)});
    }
    return out;
}

// An ellipse along its heading, with an edge that is one pixel wide.
void scene::draw(const vehicle& v, point at, std::vector<float>& onto) const {
    const double speed = std::hypot(v.velocity.x, v.velocity.y);
    const point along{v.velocity.x / speed, v.velocity.y / speed};
    const int reach = static_cast<int>(v.half_length) + 2;
    for (int y = static_cast<int>(at.y) - reach; y <= static_cast<int>(at.y) + reach; ++y) {
        for (int x = static_cast<int>(at.x) - reach; x <= static_cast<int>(at.x) + reach; ++x) {
            if (x < 0 || y < 0 || x >= size.width || y >= size.height) {
                continue;
            }
            const double dx = x - at.x;
            const double dy = y - at.y;
            const double forth = (dx * along.x + dy * along.y) / v.half_length;
            const double aside = (dy * along.x - dx * along.y) / v.half_width;
            const double inside = (1 - std::hypot(forth, aside)) * v.half_width + 0.5;
            onto[size.at(x, y)] += static_cast<float>(std::clamp(inside, 0.0, 1.0) * v.contrast);
        }
    }
}

fmv::grey scene::frame(std::uint64_t number) const {
    const auto from = camera(number);
    const double left = std::floor(from.x);
    const double top = std::floor(from.y);
    const auto u = static_cast<float>(from.x - left);
    const auto v = static_cast<float>(from.y - top);
    std::vector<float> light(size.pixels());
    for (int y = 0; y < size.height; ++y) {
        auto i = ground_size.at(margin + static_cast<int>(left), y + margin + static_cast<int>(top));
        const auto below = static_cast<std::size_t>(ground_size.width);
        for (int x = 0; x < size.width; ++x, ++i) {
            const float upper = ground_[i] + (ground_[i + 1] - ground_[i]) * u;
            const float lower = ground_[i + below] + (ground_[i + below + 1] - ground_[i + below]) * u;
            light[size.at(x, y)] = upper + (lower - upper) * v;
        }
    }
    const auto places = truth(static_cast<double>(number));
    for (std::size_t i = 0; i < vehicles_.size(); ++i) {
        draw(vehicles_[i], {places[i].x - from.x, places[i].y - from.y}, light);
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
