// SPDX-License-Identifier: BSL-1.0
#include "core/run_index.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(run_index)

BOOST_AUTO_TEST_CASE(a_run_is_found_by_its_epoch) {
    cles::core::run_index<int> runs;
    int car = 0;
    BOOST_TEST(runs.find(7) == nullptr);
    runs.add(7, &car);
    BOOST_TEST(runs.find(7) == &car);
    BOOST_TEST(runs.contains(7));
    runs.remove(7, &car);
    BOOST_TEST(runs.find(7) == nullptr);
    BOOST_TEST(!runs.contains(7));
    runs.remove(7, &car);
}

BOOST_AUTO_TEST_CASE(an_epoch_that_two_have_tells_nothing) {
    cles::core::run_index<int> runs;
    int first = 0;
    int second = 0;
    runs.add(7, &first);
    runs.add(7, &second);
    BOOST_TEST(runs.find(7) == nullptr);
    BOOST_TEST(runs.is_shared(7));
    BOOST_TEST(!runs.is_shared(8));
    runs.remove(7, &first);
    BOOST_TEST(runs.find(7) == &second);
    runs.add(7, &first);
    runs.remove(7, &first);
    BOOST_TEST(runs.find(7) == &second);
    runs.remove(7, &first); // which is not there
    BOOST_TEST(runs.find(7) == &second);
}

BOOST_AUTO_TEST_SUITE_END()
