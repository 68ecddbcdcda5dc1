// SPDX-License-Identifier: BSL-1.0
#include "fmv/background.hpp"

#include <boost/test/unit_test.hpp>

namespace background {
namespace {

constexpr fmv::extent size{.width = 64, .height = 64};

} // namespace
} // namespace background

BOOST_AUTO_TEST_SUITE(background)

BOOST_AUTO_TEST_CASE(what_passes_by_while_it_learns_leaves_nothing) {
    fmv::background still{size};
    for (int i = 0; i < fmv::background::learning; ++i) {
        BOOST_TEST(!still.known());
        fmv::grey frame(size.pixels(), 100);
        for (int k = 0; k < 8; ++k) { // a pixel a frame, eight pixels long
            frame[size.at(10 + i + k, 30)] = 200;
        }
        still.learn(frame);
    }
    BOOST_TEST(still.known());
    for (const float value : still.values()) {
        BOOST_TEST_REQUIRE(value == 100);
    }
}

BOOST_AUTO_TEST_CASE(it_follows_the_light_but_slowly_what_was_detected) {
    fmv::background still{size};
    while (!still.known()) {
        still.learn(fmv::grey(size.pixels(), 100));
    }
    fmv::grey moving(size.pixels());
    moving[size.at(5, 5)] = 1;
    for (int i = 0; i < 40; ++i) {
        still.follow(fmv::grey(size.pixels(), 120), moving);
    }
    BOOST_TEST(still.values()[size.at(20, 20)] > 118);
    BOOST_TEST(still.values()[size.at(20, 20)] < 120);
    BOOST_TEST(still.values()[size.at(5, 5)] < 104);
    BOOST_TEST(still.values()[size.at(5, 5)] > 100);
}

BOOST_AUTO_TEST_CASE(what_is_not_seen_does_not_differ_and_what_is_new_is_background) {
    fmv::background still{size};
    fmv::grey seen(size.pixels(), 1);
    seen[size.at(5, 5)] = 0;
    const auto show = [&](std::uint8_t brightness) {
        fmv::grey frame(size.pixels(), brightness);
        frame[size.at(5, 5)] = seen[size.at(5, 5)] != 0 ? 170 : 0;
        still.complete(frame, seen);
        return frame;
    };
    while (!still.known()) {
        still.learn(show(100));
    }
    seen[size.at(5, 5)] = 1; // for the first time
    seen[size.at(9, 9)] = 0;
    const auto frame = show(120);
    BOOST_TEST(still.values()[size.at(5, 5)] == 170);
    BOOST_TEST(frame[size.at(9, 9)] == 100);
    BOOST_TEST(frame[size.at(20, 20)] == 120);
}

BOOST_AUTO_TEST_SUITE_END()
