// SPDX-License-Identifier: BSL-1.0
#include "protocol/grammar.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

BOOST_AUTO_TEST_SUITE(parts)

BOOST_AUTO_TEST_CASE(parts_are_read_one_by_one_up_to_the_body) {
    cles::protocol::part_reader reader{"  PUSH   car1:log id=7  { \"a b\" : 1 } x"};
    std::vector<std::string> taken;
    for (auto part = reader.next(); !part.empty(); part = reader.next()) {
        taken.emplace_back(part);
    }
    const std::vector<std::string> expected{"PUSH", "car1:log", "id=7"};
    BOOST_TEST(taken == expected, boost::test_tools::per_element());
    BOOST_TEST(reader.rest() == "{ \"a b\" : 1 } x");
    BOOST_TEST(reader.next().empty()); // and it stays so
}

BOOST_AUTO_TEST_CASE(without_a_body_nothing_is_left) {
    cles::protocol::part_reader reader{"PULL car1:speed  "};
    reader.next();
    reader.next();
    BOOST_TEST(reader.next().empty());
    BOOST_TEST(reader.rest().empty());
    BOOST_TEST(cles::protocol::part_reader{""}.next().empty());
}

BOOST_AUTO_TEST_CASE(an_adverb_is_a_key_of_lower_case_letters_and_underscores_and_a_visible_value) {
    cles::protocol::adverb a;
    BOOST_TEST(cles::protocol::split_adverb("must_x=a=b", a));
    BOOST_TEST(a.key == "must_x");
    BOOST_TEST(a.value == "a=b");
    for (const std::string_view bad :
         {"", "=", "a", "a=", "=a", "A=1", "a1=1", "a-b=1", "a=\x1F", "a=\x7F", "a=\x80", "\xC3\xA4=1"}) {
        BOOST_TEST(!cles::protocol::split_adverb(bad, a), bad);
    }
}

BOOST_AUTO_TEST_CASE(a_number_lies_between_its_bounds_both_included) {
    using cles::protocol::number_between;
    BOOST_TEST(number_between("1", 1, 16).value() == 1U);
    BOOST_TEST(number_between("16", 1, 16).value() == 16U);
    for (const std::string_view bad : {"0", "17", "", "x", "01", "-1", "99999999999999999999"}) {
        BOOST_TEST(!number_between(bad, 1, 16).has_value(), bad);
    }
}

BOOST_AUTO_TEST_CASE(numbers_are_appended_over_their_whole_range) {
    std::string out = "id=";
    cles::protocol::append_number(out, std::numeric_limits<std::uint64_t>::max());
    BOOST_TEST(out == "id=18446744073709551615");
}

BOOST_AUTO_TEST_SUITE_END()
