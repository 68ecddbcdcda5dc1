// SPDX-License-Identifier: BSL-1.0
#include "fmv/frame_codec.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>
#include <string_view>

BOOST_AUTO_TEST_SUITE(without_jpeg)

BOOST_AUTO_TEST_CASE(frames_are_uncompressed) {
    constexpr fmv::extent size{.width = 64, .height = 64};
    const fmv::grey frame(size.pixels(), 7);
    BOOST_TEST(!fmv::has_jpeg());
    BOOST_TEST(fmv::default_format() == std::string_view{"grey"});
    BOOST_TEST((fmv::decode(fmv::encode(frame, size, fmv::default_format()), size, fmv::default_format()) == frame));
    BOOST_CHECK_THROW(fmv::encode(frame, size, "jpeg"), std::runtime_error);
    BOOST_TEST(!fmv::decode("Zm9v", size, "jpeg"));
}

BOOST_AUTO_TEST_SUITE_END()
