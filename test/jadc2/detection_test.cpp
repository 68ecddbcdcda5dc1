// SPDX-License-Identifier: BSL-1.0
// What the whole algorithm has to achieve, on scenes whose ground truth it does not get: of 100 vehicles in a frame it
// finds 90, and in ten frames there is at most one false track. On the ground, tracks are as accurate as they say.
#include "fmv/frame_codec.hpp"
#include "fmv/stream.hpp"
#include "jadc2/scene.hpp"
#include "jadc2/track_evaluation.hpp"
#include "support/amount.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <utility>

namespace detection {
namespace {

constexpr std::uint64_t frames = 80;
constexpr std::uint64_t many = cles::test::amount(20U, 2U);
constexpr std::uint64_t some = cles::test::amount(5U, 1U);

struct result {
    double found = 0, vehicles = 0, false_tracks = 0, frames = 0;
    double place_squares = 0, velocity_squares = 0, sigma_squares = 0, sigma_v_squares = 0;
};

void film(std::uint64_t seed, double fps, const char* format, result& sum) {
    const jadc2::scene ground{seed};
    const double begin = static_cast<double>(seed) * 777;
    jadc2::track_evaluation evaluation{ground};
    evaluation.begin(0, begin);
    fmv::stream video{jadc2::scene::size};
    for (std::uint64_t i = 0; i < frames; ++i) {
        const double utc = begin + static_cast<double>(i) / fps;
        const auto sent = fmv::encode(ground.frame(i, utc), jadc2::scene::size, format);
        video.take(fmv::decode(sent, jadc2::scene::size, format).value(), ground.reported(utc), utc);
        evaluation.add(utc, video.tracks(), video.ready());
    }
    const auto& sums = evaluation.found().sums();
    sum.found += static_cast<double>(sums.found);
    sum.vehicles += static_cast<double>(sums.vehicles);
    sum.false_tracks += static_cast<double>(sums.false_tracks);
    sum.frames += static_cast<double>(sums.frames);
    sum.place_squares += std::pow(evaluation.place_error(), 2);
    sum.velocity_squares += std::pow(evaluation.velocity_error(), 2);
    if (const auto tracks = video.tracks(); !tracks.empty()) { // they are the same for all
        sum.sigma_squares += std::pow(tracks.front().sigma, 2);
        sum.sigma_v_squares += std::pow(tracks.front().sigma_v, 2);
    }
}

result film_all(double fps, const char* format, std::uint64_t scenes) {
    result sum;
    for (std::uint64_t seed = 1; seed <= scenes; ++seed) {
        film(seed, fps, format, sum);
    }
    for (double* each : {&sum.place_squares, &sum.velocity_squares, &sum.sigma_squares, &sum.sigma_v_squares}) {
        *each /= static_cast<double>(scenes);
    }
    BOOST_TEST_MESSAGE(fps << " fps, " << format << ": recall " << sum.found / sum.vehicles << ", false tracks a frame "
                           << sum.false_tracks / sum.frames << ", off by " << std::sqrt(sum.place_squares)
                           << " m instead of " << std::sqrt(sum.sigma_squares) << " m, by "
                           << std::sqrt(sum.velocity_squares) << " m/s instead of " << std::sqrt(sum.sigma_v_squares)
                           << " m/s");
    return sum;
}

} // namespace
} // namespace detection

BOOST_AUTO_TEST_SUITE(detection)

BOOST_AUTO_TEST_CASE(of_many_scenes_nine_of_ten_vehicles_are_found_and_few_that_are_none) {
    const auto sum = film_all(25, fmv::default_format(), many);
    BOOST_TEST(sum.frames == static_cast<double>(many * (frames - fmv::background::learning + 1)));
    BOOST_TEST(sum.vehicles > sum.frames); // several in each
    BOOST_TEST(sum.found / sum.vehicles >= 0.9);
    BOOST_TEST(sum.false_tracks / sum.frames <= 0.1);
    // The error of a place is the same in all frames of a scene: there are as few samples as scenes.
    BOOST_TEST(std::sqrt(sum.place_squares) < cles::test::amount(1.5, 3.0) * std::sqrt(sum.sigma_squares));
    BOOST_TEST(std::sqrt(sum.velocity_squares) < 1.5 * std::sqrt(sum.sigma_v_squares));
}

BOOST_AUTO_TEST_CASE(also_without_compression_and_at_a_lower_rate) {
    using setup = std::pair<double, const char*>;
    for (const auto& [fps, format] : {setup{25, "grey"}, setup{10, fmv::default_format()}}) {
        const auto sum = film_all(fps, format, some);
        BOOST_TEST(sum.found / sum.vehicles >= 0.9);
        BOOST_TEST(sum.false_tracks / sum.frames <= 0.1);
    }
}

BOOST_AUTO_TEST_CASE(it_finds_nothing_before_it_knows_what_stands_still) {
    const jadc2::scene ground{1};
    fmv::stream video{jadc2::scene::size};
    for (std::uint64_t i = 0; i < fmv::background::learning; ++i) {
        BOOST_TEST(!video.ready());
        const double utc = static_cast<double>(i) * 0.04;
        video.take(ground.frame(i, utc), ground.reported(utc), utc);
        BOOST_TEST(video.tracks().empty());
    }
    BOOST_TEST(video.ready());
}

// While the camera shows something else, all of a map would move with it, and then tracks were elsewhere.
BOOST_AUTO_TEST_CASE(after_the_camera_saw_nothing_tracks_are_where_they_were) {
    const auto& size = jadc2::scene::size;
    const fmv::grey cloud(size.pixels(), 120);
    for (const bool looks_away : {true, false}) {
        for (const int frames_without : {25, 60}) { // with the second, the stream begins anew
            const jadc2::scene ground{3};
            fmv::stream video{size};
            jadc2::track_evaluation before{ground};
            jadc2::track_evaluation after{ground};
            before.begin(0, 0);
            std::uint64_t number = 0;
            const auto take = [&](bool sees) {
                const double utc = static_cast<double>(number) * 0.04;
                auto camera = ground.reported(utc);
                camera.azimuth += !sees && looks_away ? 90 : 0;
                video.take(sees ? ground.frame(number, utc) : cloud, camera, utc);
                ++number;
                return utc;
            };
            for (int i = 0; i < 60; ++i) {
                before.add(take(true), video.tracks(), video.ready());
            }
            BOOST_TEST(before.found().recall() >= 0.9);
            for (int i = 0; i < frames_without; ++i) {
                take(false);
            }
            BOOST_TEST(video.tracks().empty());
            const double back = take(true);
            after.begin(number, back);
            for (int i = 0; i < 60; ++i) {
                const double utc = take(true);
                after.add(utc, video.tracks(), video.ready() && i > 15);
            }
            BOOST_TEST_MESSAGE("away for " << frames_without << " frames: off by " << before.place_error()
                                           << " m, then " << after.place_error() << " m");
            BOOST_TEST(after.found().recall() >= 0.9);
            BOOST_TEST(after.place_error() < before.place_error() + 1);
        }
    }
}

// After a pause, few frames are as rare as it would make them.
BOOST_AUTO_TEST_CASE(after_a_pause_velocities_are_as_inaccurate_as_before) {
    const jadc2::scene ground{3};
    fmv::stream video{jadc2::scene::size};
    double utc = 0;
    const auto take = [&](std::uint64_t number) {
        video.take(ground.frame(number, utc), ground.reported(utc), utc);
        utc += 0.04;
    };
    for (std::uint64_t i = 0; i < 60; ++i) {
        take(i);
    }
    BOOST_TEST_REQUIRE(!video.tracks().empty());
    const double before = video.tracks().front().sigma_v;
    utc += 5;
    for (std::uint64_t i = 60; i < 75; ++i) {
        take(i);
    }
    BOOST_TEST_REQUIRE(!video.tracks().empty());
    BOOST_TEST(video.tracks().front().sigma_v > before / 2);
}

// The aircraft flies a part of its circle, so that all of the picture turns, and the wrong direction of its camera
// too.
BOOST_AUTO_TEST_CASE(vehicles_are_found_from_all_sides) {
    const jadc2::scene ground{2};
    fmv::stream video{jadc2::scene::size};
    jadc2::track_evaluation evaluation{ground};
    evaluation.begin(0, 0);
    std::uint64_t late = 0;
    for (std::uint64_t i = 0; i < 300; ++i) {
        const double utc = static_cast<double>(i) * 0.1;
        video.take(ground.frame(i, utc), ground.reported(utc), utc);
        evaluation.add(utc, video.tracks(), video.ready());
        late = i == 200 ? evaluation.found().sums().found : late;
    }
    BOOST_TEST_MESSAGE("a part of a circle: recall " << evaluation.found().recall() << ", false tracks a frame "
                                                     << evaluation.found().false_per_frame());
    BOOST_TEST(evaluation.found().recall() >= 0.9);
    BOOST_TEST(evaluation.found().false_per_frame() <= 0.1);
    BOOST_TEST(evaluation.found().sums().found > late + 100);
}

BOOST_AUTO_TEST_SUITE_END()
