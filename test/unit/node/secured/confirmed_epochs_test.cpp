// SPDX-License-Identifier: BSL-1.0
#include "node/secured/confirmed_epochs.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

BOOST_AUTO_TEST_SUITE(confirmed_epochs)

using namespace std::chrono_literals;

namespace {

const cles::time_point start{1h};

} // namespace

BOOST_AUTO_TEST_CASE(the_last_confirmed_epoch_of_a_node_counts) {
    cles::core::confirmed_epochs known{4};
    BOOST_TEST(!known.contain("car1", 1));
    known.confirm("car1", {1}, start);
    BOOST_TEST(known.contain("car1", 1));
    BOOST_TEST(!known.contain("car2", 1));
    known.confirm("car1", {2}, start);
    BOOST_TEST(known.contain("car1", 2));
    BOOST_TEST(!known.contain("car1", 1));
}

BOOST_AUTO_TEST_CASE(a_node_is_asked_once_a_second) {
    cles::core::confirmed_epochs known{4};
    BOOST_TEST((known.next_question("car1") <= start));
    known.on_asked("car1", start);
    BOOST_TEST((known.next_question("car1") == start + 1s));
    BOOST_TEST((known.next_question("car2") <= start));
    BOOST_TEST(!known.contain("car1", 0)); // asked, but not confirmed
}

BOOST_AUTO_TEST_CASE(they_are_bounded) {
    cles::core::confirmed_epochs known{2};
    known.confirm("car1", {1}, start);
    known.confirm("car2", {1}, start + 1s);
    known.confirm("car1", {1}, start + 2s);
    known.confirm("car3", {1}, start + 3s);
    BOOST_TEST(known.size() == 2U);
    BOOST_TEST(known.contain("car1", 1));
    BOOST_TEST(!known.contain("car2", 1));
    cles::core::confirmed_epochs none{0};
    none.confirm("car1", {1}, start);
    none.confirm("car2", {1}, start);
    BOOST_TEST(none.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
