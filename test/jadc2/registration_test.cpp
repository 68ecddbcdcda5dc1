// SPDX-License-Identifier: BSL-1.0
#include "fmv/registration.hpp"
#include "sgd/random_source.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdlib>

namespace registration {
namespace {

constexpr fmv::extent size{.width = 96, .height = 80};

// An unlimited texture, of which pictures show a part.
std::uint8_t ground(int x, int y) {
    sgd::random_source chance{static_cast<std::uint64_t>((y + 50) / 3 * 1000 + (x + 50) / 3)};
    return static_cast<std::uint8_t>(60 + chance.below(120));
}

fmv::rectified picture_from(int left, int top) {
    fmv::rectified out{.pixels = fmv::grey(size.pixels()), .seen = fmv::grey(size.pixels(), 1)};
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
            out.pixels[size.at(x, y)] = ground(x + left, y + top);
        }
    }
    return out;
}

} // namespace
} // namespace registration

BOOST_AUTO_TEST_SUITE(registration)

BOOST_AUTO_TEST_CASE(each_shift_is_found) {
    const auto reference = picture_from(0, 0).pixels;
    for (int dy = -fmv::most_shift; dy <= fmv::most_shift; ++dy) {
        for (int dx = -fmv::most_shift; dx <= fmv::most_shift; ++dx) {
            BOOST_TEST((fmv::register_with(reference, picture_from(dx, dy), size) == fmv::shift{dx, dy}));
        }
    }
}

BOOST_AUTO_TEST_CASE(what_moves_in_it_does_not_mislead) {
    auto picture = picture_from(2, -3);
    for (int y = 20; y < 36; ++y) {
        for (int x = 30; x < 50; ++x) {
            picture.pixels[size.at(x, y)] = 255;
        }
    }
    BOOST_TEST((fmv::register_with(picture_from(0, 0).pixels, picture, size) == fmv::shift{2, -3}));
}

BOOST_AUTO_TEST_CASE(what_was_not_seen_does_not_count) {
    auto picture = picture_from(-1, 3);
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width / 2; ++x) { // as if nothing had moved there
            picture.pixels[size.at(x, y)] = ground(x, y);
            picture.seen[size.at(x, y)] = 0;
        }
    }
    BOOST_TEST((fmv::register_with(picture_from(0, 0).pixels, picture, size) == fmv::shift{-1, 3}));
}

BOOST_AUTO_TEST_CASE(a_change_of_light_does_not_mislead) {
    auto picture = picture_from(3, 1);
    for (auto& pixel : picture.pixels) {
        pixel = static_cast<std::uint8_t>(pixel - 40);
    }
    BOOST_TEST((fmv::register_with(picture_from(0, 0).pixels, picture, size) == fmv::shift{3, 1}));
}

BOOST_AUTO_TEST_CASE(without_anything_to_tell_it_by_there_is_no_shift) {
    const auto reference = picture_from(0, 0).pixels;
    const fmv::rectified uniform{.pixels = fmv::grey(size.pixels(), 90), .seen = fmv::grey(size.pixels(), 1)};
    BOOST_TEST(!fmv::register_with(reference, uniform, size));
    BOOST_TEST(!fmv::register_with(uniform.pixels, uniform, size));
    BOOST_TEST(!fmv::register_with(reference, picture_from(5000, 5000), size)); // another place
    auto picture = picture_from(1, 1);
    picture.seen.assign(size.pixels(), 0);
    BOOST_TEST(!fmv::register_with(reference, picture, size));
    for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width / 3; ++x) {
            picture.seen[size.at(x, y)] = 1;
        }
    }
    BOOST_TEST((fmv::register_with(reference, picture, size) == fmv::shift{1, 1}));
}

BOOST_AUTO_TEST_CASE(an_aligned_picture_is_the_reference_where_it_was_seen) {
    const auto reference = picture_from(0, 0).pixels;
    for (const auto by : {fmv::shift{0, 0}, fmv::shift{3, -2}, fmv::shift{-4, 4}}) {
        auto picture = picture_from(by.dx, by.dy);
        fmv::align(picture, size, by);
        std::size_t seen = 0;
        for (std::size_t i = 0; i < reference.size(); ++i) {
            BOOST_TEST_REQUIRE((picture.seen[i] == 0 || picture.pixels[i] == reference[i]));
            seen += picture.seen[i];
        }
        BOOST_TEST(seen == static_cast<std::size_t>((size.width - std::abs(by.dx)) * (size.height - std::abs(by.dy))));
    }
}

BOOST_AUTO_TEST_SUITE_END()
