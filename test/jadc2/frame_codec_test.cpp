// SPDX-License-Identifier: BSL-1.0
#include "fmv/base64.hpp"
#include "fmv/frame_codec.hpp"
#include "jadc2/scene.hpp"
#include "sgd/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <cmath>
#include <cstdlib>
#include <vector>

using jadc2::scene;

namespace frame_codec {
namespace {

using bytes = std::vector<std::uint8_t>;

void append(bytes& to, const bytes& what) { to.insert(to.end(), what.begin(), what.end()); }

void append_segment(bytes& to, std::uint8_t marker, const bytes& content) {
    const auto length = content.size() + 2;
    append(to, {0xff, marker, static_cast<std::uint8_t>(length >> 8U), static_cast<std::uint8_t>(length & 0xffU)});
    append(to, content);
}

std::uint8_t high(int number) { return static_cast<std::uint8_t>(number / 256); }
std::uint8_t low(int number) { return static_cast<std::uint8_t>(number % 256); }

// A progressive JPEG of one colour, in one pass for the means of its blocks and so many empty ones for all else. Every
// pass costs time for each block, and hardly a byte.
bytes in_passes(int passes, fmv::extent size) {
    const int blocks = ((size.width + 7) / 8) * ((size.height + 7) / 8);
    bytes out{0xff, 0xd8};
    bytes quantization(65, 1);
    quantization[0] = 0;
    append_segment(out, 0xdb, quantization);
    append_segment(out, 0xc2,
                   {8, high(size.height), low(size.height), high(size.width), low(size.width), 1, 1, 0x11, 0});
    bytes code(18, 0); // one code word: 0
    code[1] = 1;
    append_segment(out, 0xc4, code); // no difference from the block before
    code[0] = 0x10;
    code[17] = 0xe0; // the next 16384 blocks, and more, are empty
    append_segment(out, 0xc4, code);
    append_segment(out, 0xda, {1, 1, 0, 0, 0, 0});
    append(out, bytes(static_cast<std::size_t>(blocks / 8 + 2), 0));
    bytes pass;
    append_segment(pass, 0xda, {1, 1, 0, 1, 63, 0});
    append(pass, bytes(static_cast<std::size_t>(2 * ((blocks + 16383) / 16384) + 1), 0));
    for (int i = 0; i < passes; ++i) {
        append(out, pass);
    }
    append(out, {0xff, 0xd9});
    return out;
}

auto decoded(const bytes& jpeg, fmv::extent size = scene::size) {
    return fmv::decode(fmv::to_base64(jpeg), size, "jpeg");
}

} // namespace
} // namespace frame_codec

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

// A few kilobytes could otherwise occupy a worker for minutes.
BOOST_AUTO_TEST_CASE(a_jpeg_in_too_many_passes_is_refused,
                     *boost::unit_test::precondition([](auto) { return fmv::has_jpeg(); })) {
    BOOST_TEST(decoded(in_passes(1, scene::size)).has_value());
    BOOST_TEST(!decoded(in_passes(600, scene::size)));
}

BOOST_AUTO_TEST_CASE(the_size_is_compared_before_memory_is_taken,
                     *boost::unit_test::precondition([](auto) { return fmv::has_jpeg(); })) {
    BOOST_TEST(!decoded(in_passes(1, {.width = 65'500, .height = 65'500})));
}

BOOST_AUTO_TEST_CASE(damaged_jpegs_do_no_harm, *boost::unit_test::precondition([](auto) { return fmv::has_jpeg(); })) {
    constexpr fmv::extent size{.width = 64, .height = 64};
    fmv::grey frame(size.pixels());
    sgd::random_source chance{5};
    for (auto& pixel : frame) {
        pixel = static_cast<std::uint8_t>(chance.below(256));
    }
    const auto text = fmv::encode(frame, size, "jpeg");
    const auto jpeg = fmv::from_base64(text, fmv::base64_size(text)).value();
    int readable = 0;
    for (int i = 0; i < 3000; ++i) {
        auto damaged = jpeg;
        for (int k = 0; k <= i % 4; ++k) {
            damaged[chance.below(static_cast<std::uint32_t>(damaged.size()))] =
                static_cast<std::uint8_t>(chance.below(256));
        }
        const auto picture = decoded(damaged, size);
        BOOST_TEST_REQUIRE((!picture || picture->size() == size.pixels()));
        readable += picture ? 1 : 0;
    }
    BOOST_TEST(readable > 0); // that a byte differs is not always an error
    BOOST_TEST(readable < 3000);
}

BOOST_AUTO_TEST_SUITE_END()
