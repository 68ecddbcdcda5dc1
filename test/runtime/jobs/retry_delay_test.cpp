// SPDX-License-Identifier: BSL-1.0
#include "jobs/service_time.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <limits>

BOOST_AUTO_TEST_SUITE(retry_delay)

using cles::runtime::max_retry;
using cles::runtime::min_retry;
using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(it_is_the_time_for_half_of_the_queue) {
    BOOST_TEST((cles::runtime::retry_delay(100, 1, 10ms) == 500ms));
    BOOST_TEST((cles::runtime::retry_delay(100, 4, 10ms) == 125ms));
    BOOST_TEST((cles::runtime::retry_delay(101, 2, 1ms) == 26ms)); // not earlier
}

BOOST_AUTO_TEST_CASE(it_is_bounded) {
    BOOST_TEST((cles::runtime::retry_delay(0, 2, 10ms) == min_retry));
    BOOST_TEST((cles::runtime::retry_delay(1024, 2, 0ms) == min_retry));
    BOOST_TEST((cles::runtime::retry_delay(1024, 1, 1h) == max_retry));
    BOOST_TEST((cles::runtime::retry_delay(std::numeric_limits<std::size_t>::max(), 1,
                                           std::chrono::nanoseconds::max()) == max_retry));
}

BOOST_AUTO_TEST_CASE(no_worker_counts_as_one) { BOOST_TEST((cles::runtime::retry_delay(100, 0, 10ms) == 500ms)); }

BOOST_AUTO_TEST_SUITE_END()
