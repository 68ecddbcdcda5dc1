// SPDX-License-Identifier: BSL-1.0
#include "node/membership/incarnation.hpp"

#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(epoch_index)

BOOST_AUTO_TEST_CASE(incarnation_is_found_by_its_epoch) {
    cles::core::epoch_index<int> runs;
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

BOOST_AUTO_TEST_CASE(shared_epoch_finds_nothing) {
    cles::core::epoch_index<int> runs;
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
    runs.remove(7, &first); // not present
    BOOST_TEST(runs.find(7) == &second);
}

BOOST_AUTO_TEST_SUITE_END()
