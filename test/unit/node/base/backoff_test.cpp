// SPDX-License-Identifier: BSL-1.0
#include "node/base/backoff.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <set>

namespace backoff {
namespace {

using namespace std::chrono_literals;

} // namespace
} // namespace backoff

BOOST_AUTO_TEST_SUITE(backoff)

BOOST_AUTO_TEST_CASE(pauses_double_up_to_the_longest_and_are_shortened_by_a_quarter_at_most) {
    for (std::uint32_t seed = 0; seed < 200; ++seed) {
        cles::core::backoff pauses{seed, 100ms, 5000ms};
        for (const auto full : {100ms, 200ms, 400ms, 800ms, 1600ms, 3200ms, 5000ms, 5000ms, 5000ms}) {
            const auto pause = pauses.next();
            BOOST_REQUIRE(pause <= full);
            BOOST_REQUIRE(pause >= full * 3 / 4);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_success_resets_the_pauses) {
    cles::core::backoff pauses{7, 100ms, 5000ms};
    for (int i = 0; i < 10; ++i) {
        pauses.next();
    }
    pauses.reset();
    BOOST_CHECK(pauses.next() <= 100ms);
}

BOOST_AUTO_TEST_CASE(nodes_that_lost_the_same_peer_do_not_return_together) {
    std::set<std::chrono::milliseconds> seen;
    for (std::uint32_t seed = 0; seed < 50; ++seed) {
        cles::core::backoff pauses{seed * 2654435761U};
        pauses.next();
        pauses.next();
        seen.insert(pauses.next());
    }
    BOOST_TEST(seen.size() > 20U);
}

BOOST_AUTO_TEST_CASE(the_shortest_pause_does_not_shrink_to_zero) {
    cles::core::backoff pauses{1, 1ms, 2ms};
    for (int i = 0; i < 10; ++i) {
        BOOST_CHECK(pauses.next() >= 1ms);
    }
}

BOOST_AUTO_TEST_SUITE_END()
