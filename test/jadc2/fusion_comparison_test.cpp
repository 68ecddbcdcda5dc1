// SPDX-License-Identifier: BSL-1.0
// What the fusion of the video with the plots of the satellite's own radar has to achieve, from the pixels to the place
// of a track: clearly better than the video alone, and about as good as it says.
#include "jadc2/fusion_comparison.hpp"
#include "support/amount.hpp"

#include <boost/test/unit_test.hpp>

namespace fusion_comparison {
namespace {

constexpr std::uint64_t scenes = cles::test::amount(8U, 1U);

} // namespace
} // namespace fusion_comparison

BOOST_AUTO_TEST_SUITE(fusion_comparison)

BOOST_AUTO_TEST_CASE(two_sources_are_more_accurate_than_one) {
    const auto both = jadc2::compare_sources({.scenes = scenes});
    BOOST_TEST_MESSAGE("of " << both.scenes << " scenes, " << both.fused << " fused: off by "
                             << both.with_plots.observed_sigma << " m instead of " << both.with_plots.expected_sigma
                             << " m; by the camera alone " << both.camera_alone.observed_sigma << " m instead of "
                             << both.camera_alone.expected_sigma << " m");
    BOOST_TEST(4 * both.scenes >= 3 * scenes);
    BOOST_TEST(4 * both.fused >= 3 * both.scenes);
    if (both.scenes == 0) {
        return;
    }
    BOOST_TEST(both.with_plots.expected_sigma < both.camera_alone.expected_sigma);
    // One scene may be right by chance.
    BOOST_TEST(both.with_plots.observed_sigma < cles::test::amount(0.7, 10.0) * both.camera_alone.observed_sigma);
    BOOST_TEST(both.with_plots.observed_sigma < cles::test::amount(2.0, 4.0) * both.with_plots.expected_sigma);
}

BOOST_AUTO_TEST_SUITE_END()
