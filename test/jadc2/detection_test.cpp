// SPDX-License-Identifier: BSL-1.0
// What the whole algorithm has to achieve, on scenes whose ground truth it does not get: of 100 vehicles in a frame it
// finds 90, and in ten frames there is at most one false track.
#include "fmv/stream.hpp"
#include "jadc2/scene.hpp"
#include "jadc2/score.hpp"

#include <boost/test/unit_test.hpp>

namespace detection {
namespace {

constexpr std::uint64_t frames = 80;
constexpr std::uint64_t scenes = CLES_DETECTION_IS_SLOW ? 2 : 20;
// It learns the background, and has to see a target several times.
constexpr std::uint64_t settled = fmv::background::learning + 10;

void judge(std::uint64_t seed, jadc2::score& total) {
    const jadc2::scene ground{seed};
    const auto first = ground.camera(0);
    fmv::stream video{jadc2::scene::size};
    for (std::uint64_t i = 0; i < frames; ++i) {
        video.take(ground.frame(i));
        std::vector<fmv::point> places;
        for (const auto& t : video.targets()) {
            places.push_back({t.at.x + first.x, t.at.y + first.y});
        }
        if (i >= settled) {
            total.add(ground.truth(static_cast<double>(i)), places);
        }
    }
}

} // namespace
} // namespace detection

BOOST_AUTO_TEST_SUITE(detection)

BOOST_AUTO_TEST_CASE(of_many_scenes_nine_of_ten_vehicles_are_found_and_few_that_are_none) {
    jadc2::score all;
    for (std::uint64_t seed = 1; seed <= scenes; ++seed) {
        judge(seed, all);
    }
    BOOST_TEST_MESSAGE("all: recall " << all.recall() << ", false tracks a frame " << all.false_per_frame());
    BOOST_TEST(all.sums().frames == scenes * (frames - settled));
    BOOST_TEST(all.recall() >= 0.9);
    BOOST_TEST(all.false_per_frame() <= 0.1);
}

BOOST_AUTO_TEST_CASE(it_finds_nothing_before_it_knows_what_stands_still) {
    const jadc2::scene ground{1};
    fmv::stream video{jadc2::scene::size};
    for (std::uint64_t i = 0; i + 1 < fmv::background::learning; ++i) {
        video.take(ground.frame(i));
        BOOST_TEST(!video.ready());
        BOOST_TEST(video.targets().empty());
    }
    video.take(ground.frame(fmv::background::learning - 1));
    BOOST_TEST(video.ready());
}

BOOST_AUTO_TEST_SUITE_END()
