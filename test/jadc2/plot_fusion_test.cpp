// SPDX-License-Identifier: BSL-1.0
#include "fmv/plot_fusion.hpp"
#include "geo/traffic.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace plot_fusion {
namespace {

constexpr double frame_interval = 0.04; // s
constexpr fmv::stream::place_error accuracy{.map = 1, .common = 3, .own = 0.2};

struct fixture {
    /// Tracks of most vehicles, which are all off by the same.
    [[nodiscard]] std::vector<fmv::track> tracks(double utc) const {
        std::vector<fmv::track> out;
        for (const auto& each : cars.at(utc)) {
            if (std::hypot(each.at.east, each.at.north) < 150) {
                const auto at = fmv::ground_radar::plane().to_geographic(
                    {.east = each.at.east + off.east, .north = each.at.north + off.north});
                out.push_back({.id = out.size() + 1,
                               .lat = at.lat,
                               .lon = at.lon,
                               .ve = each.velocity.east,
                               .vn = each.velocity.north,
                               .sigma = 3});
            }
        }
        return out;
    }
    /// The correction after so many seconds of film.
    std::optional<fmv::place_shift> film(fmv::plot_fusion& with, double seconds) {
        std::optional<fmv::place_shift> by;
        for (int left = static_cast<int>(seconds / frame_interval); left > 0; --left) {
            utc += frame_interval;
            last = tracks(utc);
            by = with.correct(last, accuracy, utc);
        }
        return by;
    }

    const geo::traffic cars{1};
    geo::plane_position off{.east = 4, .north = -3};
    double utc = 700;
    std::vector<fmv::track> last;
};

} // namespace
} // namespace plot_fusion

BOOST_FIXTURE_TEST_SUITE(plot_fusion, fixture)

BOOST_AUTO_TEST_CASE(what_all_places_are_off_by_is_found_and_corrected) {
    fmv::plot_fusion fusion{1};
    const auto by = film(fusion, 15);
    BOOST_TEST_REQUIRE(by.has_value());
    BOOST_TEST(std::abs(by->east - off.east) < 2.5);
    BOOST_TEST(std::abs(by->north - off.north) < 2.5);
    const auto before = tracks(utc);
    BOOST_TEST_REQUIRE(!before.empty());
    BOOST_TEST_REQUIRE(before.size() == last.size());
    const auto& plane = fmv::ground_radar::plane();
    for (std::size_t i = 0; i < last.size(); ++i) {
        const auto was = plane.to_plane({.lat = before[i].lat, .lon = before[i].lon});
        const auto is = plane.to_plane({.lat = last[i].lat, .lon = last[i].lon});
        BOOST_TEST(std::abs(was.east - is.east - by->east) < 0.05);
        BOOST_TEST(std::abs(was.north - is.north - by->north) < 0.05);
        BOOST_TEST(last[i].sigma > 0.5);
        BOOST_TEST(last[i].sigma < 2);
        BOOST_TEST(last[i].ve == before[i].ve);
    }
}

BOOST_AUTO_TEST_CASE(before_the_radar_has_seen_anything_tracks_stay_as_they_are) {
    fmv::plot_fusion fusion{1};
    BOOST_TEST(!film(fusion, 0.9).has_value());
    BOOST_TEST(last.front().sigma == 3);
    BOOST_TEST(last.front().lat == tracks(utc).front().lat);
}

BOOST_AUTO_TEST_CASE(plots_of_other_vehicles_change_nothing) {
    fmv::plot_fusion elsewhere{2};
    for (int second = 0; second < 20; ++second) {
        BOOST_TEST(!film(elsewhere, 1).has_value());
    }
}

BOOST_AUTO_TEST_CASE(another_map_has_another_error) {
    fmv::plot_fusion fusion{1};
    BOOST_TEST(film(fusion, 15).has_value());
    auto now = tracks(utc);
    BOOST_TEST(!fusion.correct(now, {.map = 2, .common = 3, .own = 0.2}, utc).has_value());
}

BOOST_AUTO_TEST_SUITE_END()
