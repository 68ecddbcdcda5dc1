// SPDX-License-Identifier: BSL-1.0
#include "fmv/base64.hpp"
#include "fmv/frame_codec.hpp"
#include "jadc2/scene.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <cstdlib>

using jadc2::scene;

BOOST_AUTO_TEST_SUITE(frame_codec)

BOOST_AUTO_TEST_CASE(uncompressed_pixels_come_back) {
    const auto frame = scene{1}.frame(0, 0);
    const auto text = fmv::encode(frame, scene::size, "grey");
    BOOST_TEST((fmv::decode(text, scene::size, "grey").value() == frame));
    BOOST_TEST(!fmv::decode(text, {.width = 320, .height = 241}, "grey"));
}

BOOST_AUTO_TEST_CASE(a_jpeg_is_smaller_and_shows_the_same,
                     *boost::unit_test::precondition([](auto) { return fmv::has_jpeg(); })) {
    const auto frame = scene{1}.frame(0, 0);
    const auto text = fmv::encode(frame, scene::size, "jpeg");
    BOOST_TEST(text.size() * 3 < fmv::encode(frame, scene::size, "grey").size());
    const auto back = fmv::decode(text, scene::size, "jpeg");
    BOOST_TEST_REQUIRE(back.has_value());
    double squares = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
        squares += (frame[i] - (*back)[i]) * (frame[i] - (*back)[i]);
    }
    BOOST_TEST(std::sqrt(squares / static_cast<double>(frame.size())) < scene::noise); // less than the camera's noise
}

BOOST_AUTO_TEST_CASE(what_is_no_jpeg_of_that_size_is_refused,
                     *boost::unit_test::precondition([](auto) { return fmv::has_jpeg(); })) {
    const auto text = fmv::encode(scene{1}.frame(0, 0), scene::size, "jpeg");
    BOOST_TEST(!fmv::decode(text, {.width = 240, .height = 320}, "jpeg"));
    BOOST_TEST(!fmv::decode("", scene::size, "jpeg"));
    BOOST_TEST(!fmv::decode("Zm9v", scene::size, "jpeg"));
    BOOST_TEST(!fmv::decode("Zm9", scene::size, "jpeg"));
    BOOST_TEST(!fmv::decode("====", scene::size, "jpeg"));
    BOOST_TEST(!fmv::decode(text.substr(0, text.size() / 8 * 4), scene::size, "jpeg")); // cut off
    BOOST_TEST(!fmv::decode(fmv::to_base64(std::vector<std::uint8_t>(1000, 0xff)), scene::size, "jpeg"));
}

BOOST_AUTO_TEST_SUITE_END()
