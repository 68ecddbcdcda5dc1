// SPDX-License-Identifier: BSL-1.0
#include "digits/image_set.hpp"

#include <boost/test/unit_test.hpp>

#include <stdexcept>

namespace image_set {
namespace {

// What is wrong with the text of a file.
std::string refused(std::string_view text) {
    try {
        digits::image_set::parse(text, "file");
        return {};
    } catch (const std::invalid_argument& e) {
        return e.what();
    }
}

constexpr std::string_view header = "pixels=2,brightest=4,classes=3\n";

} // namespace
} // namespace image_set

BOOST_AUTO_TEST_SUITE(image_set)

BOOST_AUTO_TEST_CASE(a_file_is_read) {
    const auto images =
        digits::image_set::parse("pixels=2,brightest=4,classes=3,best_accuracy=0.975\n0,4,2\r\n\n1,2,0\n", "file");
    BOOST_TEST(images.size() == 2U);
    BOOST_TEST(images.image(0)[0] == 0.0F);
    BOOST_TEST(images.image(0)[1] == 1.0F);
    BOOST_TEST(images.image(1)[0] == 0.25F);
    BOOST_TEST(images.image(1).size() == 2U);
    BOOST_TEST(images.class_of(0) == 2U);
    BOOST_TEST(images.class_of(1) == 0U);
    BOOST_TEST(*images.header().best_accuracy == 0.975);
}

BOOST_AUTO_TEST_CASE(the_last_line_needs_no_end) {
    BOOST_TEST(digits::image_set::parse(std::string{image_set::header} + "1,2,0", "file").size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_is_wrong_is_told_with_file_and_line) {
    const auto line = [](const char* text) { return image_set::refused(std::string{image_set::header} + text); };
    BOOST_TEST(line("1,2\n") == "file:2: class: '' is not a whole number from 0 to 2");
    BOOST_TEST(line("1,2,0\n1,5,0\n") == "file:3: pixel: '5' is not a whole number from 0 to 4");
    BOOST_TEST(line("1,2,3\n") == "file:2: class: '3' is not a whole number from 0 to 2");
    BOOST_TEST(line("1,2,0,0\n") == "file:2: there are more than 2 pixels and a class");
    BOOST_TEST(line("1,-2,0\n") == "file:2: pixel: '-2' is not a whole number from 0 to 4");
    BOOST_TEST(line("1,two,0\n") == "file:2: pixel: 'two' is not a whole number from 0 to 4");
    BOOST_TEST(line("") == "file:1: there is no image");
    BOOST_TEST(image_set::refused("") == "file:1: pixels: 1 to 4096");
    BOOST_TEST(image_set::refused("pixels=4097,brightest=4,classes=3\n") == "file:1: pixels: 1 to 4096");
    BOOST_TEST(image_set::refused("pixels=2,brightest=0,classes=3\n") == "file:1: brightest: 1 to 65535");
    BOOST_TEST(image_set::refused("pixels=2,brightest=4,classes=1\n") == "file:1: classes: 2 to 256");
    BOOST_TEST(image_set::refused("pixels=2,brightest=4,classes=2,best_accuracy=nan\n") ==
               "file:1: best_accuracy: a number from 0 to 1");
    BOOST_TEST(image_set::refused("0,4,2\n") ==
               "file:1: the first line is like pixels=64,brightest=16,classes=10, not '0'");
}

BOOST_AUTO_TEST_CASE(images_of_another_kind_are_refused) {
    digits::image_set all{{.pixels = 2, .brightest = 4, .classes = 3}};
    all.add_line("1,2,0");
    all.add(all);
    BOOST_TEST(all.size() == 2U);
    BOOST_CHECK_THROW(all.add(digits::image_set{{.pixels = 3, .brightest = 4, .classes = 3}}), std::invalid_argument);
    BOOST_CHECK_THROW(digits::image_set::read({}), std::invalid_argument);
    BOOST_CHECK_THROW(digits::image_set::read({"/nonexistent"}), std::invalid_argument);
}

BOOST_AUTO_TEST_SUITE_END()
