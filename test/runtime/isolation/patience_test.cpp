// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_session.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

CLES_TEST_SUITE(patience)

using namespace std::chrono_literals;
using cles::runtime::patience_of;

BOOST_AUTO_TEST_CASE(it_ends_before_the_grace) {
    BOOST_TEST((patience_of(2s) == 1800ms));
    BOOST_TEST((patience_of(400ms) == 300ms));
}

BOOST_AUTO_TEST_CASE(no_job_is_overdue_before_its_deadline) {
    for (const auto grace : {0us, 1us, 1'000us, 2'000us, 3'999us, 4'000us, 5'000us}) {
        BOOST_TEST((patience_of(grace) >= grace / 2));
    }
}

BOOST_AUTO_TEST_SUITE_END()
