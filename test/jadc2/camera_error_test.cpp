// SPDX-License-Identifier: BSL-1.0
#include "fmv/camera_error.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <vector>

namespace camera_error {
namespace {

using places = std::vector<geo::plane_position>;

constexpr fmv::plot_statistics radar{.deviation = 4, .detected = 0.9, .others = 3e-4};
const places targets{{.east = 0, .north = 0}, {.east = 60, .north = -20}, {.east = -40, .north = 70}};

places moved(const places& all, geo::plane_position by) {
    places out;
    for (const auto& each : all) {
        out.push_back({.east = each.east + by.east, .north = each.north + by.north});
    }
    return out;
}

void observe(fmv::camera_error& what, int scans, const places& where, geo::plane_position off) {
    for (int i = 0; i < scans; ++i) {
        what.observe(moved(where, off), where, radar);
    }
}

} // namespace
} // namespace camera_error

BOOST_AUTO_TEST_SUITE(camera_error)

BOOST_AUTO_TEST_CASE(it_becomes_known_with_each_scan) {
    fmv::camera_error what{3};
    BOOST_TEST(!what.is_known());
    BOOST_TEST(what.deviation() == 3);
    observe(what, 2, targets, {.east = 3, .north = -2});
    BOOST_TEST(what.is_known());
    const double soon = what.deviation();
    BOOST_TEST(soon < 3);
    observe(what, 18, targets, {.east = 3, .north = -2});
    BOOST_TEST(std::abs(what.mean().east - 3) < 0.5);
    BOOST_TEST(std::abs(what.mean().north + 2) < 0.5);
    BOOST_TEST(what.deviation() < soon);
    BOOST_TEST(what.deviation() > 0.5); // the map is never exact
}

BOOST_AUTO_TEST_CASE(it_follows_if_it_changes) {
    fmv::camera_error what{3};
    observe(what, 20, targets, {.east = 3, .north = 0});
    observe(what, 100, targets, {.east = 1, .north = 0});
    BOOST_TEST(std::abs(what.mean().east - 1) < 0.5);
}

BOOST_AUTO_TEST_CASE(neighbours_are_not_taken_for_each_other) {
    fmv::camera_error what{4};
    // Nearly half way to the next one.
    observe(what, 20, {{.east = 0, .north = 0}, {.east = 10, .north = 0}, {.east = 20, .north = 0}},
            {.east = 5, .north = 0});
    BOOST_TEST(what.is_known());
    BOOST_TEST(std::abs(what.mean().east - 5) < 1);
}

BOOST_AUTO_TEST_CASE(plots_of_something_else_say_nothing) {
    fmv::camera_error what{3};
    for (int i = 0; i < 20; ++i) {
        what.observe(targets, moved(targets, {.east = 35, .north = 35}), radar);
        what.observe(targets, {}, radar);
    }
    BOOST_TEST(!what.is_known());
    observe(what, 20, targets, {.east = 1, .north = 1}); // they are the same after all
    BOOST_TEST(what.is_known());
}

BOOST_AUTO_TEST_CASE(without_targets_or_on_a_grid_that_is_too_coarse_nothing_changes) {
    fmv::camera_error none{3};
    none.observe({}, targets, radar);
    BOOST_TEST(none.deviation() == 3);
    fmv::camera_error vague{1000};
    observe(vague, 20, targets, {});
    BOOST_TEST(!vague.is_known());
    BOOST_TEST(vague.deviation() == 1000);
    fmv::camera_error exact{0};
    observe(exact, 20, targets, {});
    BOOST_TEST(exact.is_known());
    BOOST_TEST(exact.deviation() < 1);
}

BOOST_AUTO_TEST_SUITE_END()
