// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_peer.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace unanswered {
namespace {

using namespace std::chrono_literals;
using cles::time_point;

} // namespace

BOOST_AUTO_TEST_SUITE(unanswered)

BOOST_AUTO_TEST_CASE(it_is_sent_three_times_at_doubling_intervals) {
    cles::security::unanswered retry;
    const time_point start{1h};
    retry.start(start);
    BOOST_TEST((retry.due() == start + 200ms));
    BOOST_TEST(retry.expire(start + 200ms));
    BOOST_TEST((retry.due() == start + 600ms));
    BOOST_TEST(retry.expire(start + 600ms));
    BOOST_TEST((retry.due() == start + 1400ms));
    BOOST_TEST(!retry.expire(start + 1400ms));
    BOOST_TEST((retry.due() == time_point::max()));
}

BOOST_AUTO_TEST_CASE(it_stops_and_starts_anew) {
    cles::security::unanswered retry;
    BOOST_TEST((retry.due() == time_point::max()));
    retry.start(time_point{1h});
    BOOST_TEST(retry.expire(time_point{1h + 200ms}));
    retry.stop();
    BOOST_TEST((retry.due() == time_point::max()));
    retry.start(time_point{2h});
    BOOST_TEST((retry.due() == time_point{2h + 200ms}));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace unanswered
