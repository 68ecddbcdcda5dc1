// SPDX-License-Identifier: BSL-1.0
#include "node/base/backoff.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(retransmission)

using namespace std::chrono_literals;
using cles::time_point;
using std::chrono::milliseconds;

const time_point start{1h};

// The pauses between copies until the end.
std::vector<milliseconds> pauses(cles::core::retransmission& copies) {
    std::vector<milliseconds> result;
    auto last = start;
    while (!copies.over(copies.next())) {
        const auto now = copies.next();
        copies.again(now);
        result.push_back(std::chrono::duration_cast<milliseconds>(now - last));
        last = now;
    }
    return result;
}

BOOST_AUTO_TEST_CASE(the_first_copy_follows_after_200_ms_with_jitter) {
    for (std::uint32_t seed = 0; seed < 200; ++seed) {
        const cles::core::retransmission copies{"x", start, start + 5s, seed};
        BOOST_TEST((copies.next() >= start + 200ms));
        BOOST_TEST((copies.next() <= start + 250ms));
    }
}

BOOST_AUTO_TEST_CASE(every_copy_has_the_same_bytes) {
    cles::core::retransmission copies{"PUSH car1:x id=7 {}\n", start, start + 5s, 1};
    for (int i = 0; i < 4; ++i) {
        BOOST_TEST(copies.again(copies.next()) == "PUSH car1:x id=7 {}\n");
    }
}

BOOST_AUTO_TEST_CASE(pauses_double_with_jitter) {
    cles::core::retransmission copies{"x", start, start + 5s, 12345};
    const auto all = pauses(copies);
    BOOST_REQUIRE(all.size() == 4U); // 200, 400, 800, 1600; the next would be after the end
    auto expected = 200ms;
    for (const auto pause : all) {
        BOOST_TEST(pause.count() >= expected.count());
        BOOST_TEST(pause.count() <= expected.count() * 5 / 4);
        expected *= 2;
    }
}

BOOST_AUTO_TEST_CASE(many_requesters_do_not_retransmit_together) {
    std::vector<time_point> seen;
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
        seen.push_back(cles::core::retransmission{"x", start, start + 5s, seed * 7919}.next());
    }
    std::sort(seen.begin(), seen.end());
    BOOST_TEST((std::unique(seen.begin(), seen.end()) - seen.begin()) > 5);
}

BOOST_AUTO_TEST_CASE(it_ends_at_the_deadline_which_counts_from_the_first_copy) {
    cles::core::retransmission copies{"x", start, start + 1s, 1};
    pauses(copies);
    BOOST_TEST((copies.next() == start + 1s));
    BOOST_TEST(!copies.over(start + 999ms));
    BOOST_TEST(copies.over(start + 1s));
}

// A node forgets a request a minute after its reply: no copy may come so late that it would run again.
BOOST_AUTO_TEST_CASE(pauses_stay_well_below_the_time_that_a_node_remembers) {
    cles::core::retransmission copies{"x", start, start + 24h, 99};
    for (const auto pause : pauses(copies)) {
        BOOST_REQUIRE(pause.count() <= 12'500);
    }
}

BOOST_AUTO_TEST_SUITE_END()
