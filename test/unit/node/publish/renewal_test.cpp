// SPDX-License-Identifier: BSL-1.0
#include "node/publish/lease.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <set>

namespace renewal {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::renewal::keeper {
    void renew(cles::time_point until) override {
        ++renewals;
        given = until;
    }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    int renewals = 0;
    cles::time_point given{};
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::renewal lease{*this, deadlines, 7};
};

} // namespace
} // namespace renewal

BOOST_FIXTURE_TEST_SUITE(renewal, fixture)

BOOST_AUTO_TEST_CASE(it_renews_at_a_third_of_the_lease_with_jitter) {
    std::set<cles::time_point> times;
    for (std::uint32_t seed = 1; seed < 100; ++seed) {
        cles::core::renewal one{*this, deadlines, seed * 7919};
        const auto now = clock.now();
        one.begin(now, 9s);
        const auto due = *deadlines.next();
        BOOST_TEST((due >= now + 2250ms));
        BOOST_TEST((due <= now + 3s));
        times.insert(due);
    }
    BOOST_TEST(times.size() > 10U);
}

BOOST_AUTO_TEST_CASE(each_reply_renews_the_lease_from_the_time_of_the_request) {
    const auto begun = clock.now();
    lease.begin(begun, 9s);
    pass(3s);
    BOOST_TEST(renewals == 1);
    BOOST_TEST((given == begun + 9s)); // a later reply counts as none
    const auto asked = clock.now();
    pass(500ms);
    lease.renewed(asked);
    BOOST_TEST((lease.until() == asked + 9s));
    pass(2500ms);
    BOOST_TEST(renewals == 2);
}

BOOST_AUTO_TEST_CASE(a_late_reply_is_followed_by_a_renewal_at_once) {
    const auto asked = clock.now();
    clock.advance(4s);
    lease.begin(asked, 9s);
    pass(0ms);
    BOOST_TEST(renewals == 1);
}

BOOST_AUTO_TEST_CASE(a_busy_publisher_is_asked_again_until_the_lease_expires) {
    lease.begin(clock.now(), 9s);
    pass(3s);
    int tries = 0;
    while (lease.retry_later(clock.now())) {
        const auto before = renewals;
        pass(std::chrono::duration_cast<std::chrono::milliseconds>(*deadlines.next() - clock.now()) + 1ms);
        BOOST_TEST(renewals == before + 1);
        BOOST_REQUIRE(++tries < 50);
    }
    BOOST_TEST(tries >= 3);
    BOOST_TEST((lease.until() - clock.now() < 20ms));
}

BOOST_AUTO_TEST_CASE(it_does_not_renew_after_stop) {
    lease.begin(clock.now(), 9s);
    lease.stop();
    pass(1h);
    BOOST_TEST(renewals == 0);
}

BOOST_AUTO_TEST_SUITE_END()
