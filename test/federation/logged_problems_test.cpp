// SPDX-License-Identifier: BSL-1.0
#include "federation/logged_problems.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

BOOST_AUTO_TEST_SUITE(logged_problems)

BOOST_AUTO_TEST_CASE(each_is_logged_once_even_if_they_take_turns) {
    cles::bridging::logged_problems logged;
    BOOST_TEST(logged.add("a is not there"));
    BOOST_TEST(logged.add("b is not there"));
    BOOST_TEST(!logged.add("a is not there"));
    BOOST_TEST(!logged.add("b is not there"));
    logged.clear();
    BOOST_TEST(logged.add("a is not there"));
}

BOOST_AUTO_TEST_CASE(their_number_is_limited) {
    cles::bridging::logged_problems logged;
    for (std::size_t i = 0; i <= logged.most; ++i) {
        BOOST_TEST(logged.add(std::to_string(i)));
    }
    BOOST_TEST(!logged.add(std::to_string(logged.most)));
    BOOST_TEST(logged.add("0"));
}

BOOST_AUTO_TEST_SUITE_END()
