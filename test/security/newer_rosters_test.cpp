// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/newer_rosters.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>

namespace newer_rosters {
namespace {

using namespace std::chrono_literals;
using namespace cles::security::test;

struct fixture {
    test_fleet cars{20};
    cles::security::fleet known{"car1", test_fleet::key_of(1), cars.authority.share()};
    cles::security::newer_rosters newer{known};
    const std::uint32_t version = known.in_force().version();
    cles::time_point now{1h};
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(newer_rosters, fixture)

BOOST_AUTO_TEST_CASE(a_later_version_than_the_one_in_force_is_newer) {
    BOOST_TEST(!newer.has(2));
    newer.learn(2, version);
    BOOST_TEST(!newer.has(2));
    BOOST_TEST(!newer.may_fetch(2, now));
    newer.learn(2, version + 1);
    BOOST_TEST(newer.has(2));
    BOOST_TEST(newer.may_fetch(2, now));
    newer.learn(99, version + 1); // not a member
    BOOST_TEST(!newer.has(99));
    cars.authority.rotate();
    BOOST_REQUIRE((known.offer(cars.authority.newest().line()) == cles::security::fleet::verdict::adopted));
    BOOST_TEST(!newer.has(2));
}

BOOST_AUTO_TEST_CASE(one_is_fetched_at_a_time_when_all_members_have_it) {
    int fetches = 0;
    for (int i = 0; i < 100; ++i) { // of 10 ms
        for (std::uint32_t member = 2; member <= 20; ++member) {
            newer.learn(member, version + 1);
            fetches += newer.may_fetch(member, now) ? 1 : 0;
        }
        now += 10ms;
    }
    BOOST_TEST(fetches == 5);
}

BOOST_AUTO_TEST_CASE(from_one_member_it_is_fetched_every_ten_seconds) {
    newer.learn(2, version + 1);
    BOOST_TEST(newer.may_fetch(2, now));
    now += 10s - 1ns;
    BOOST_TEST(!newer.may_fetch(2, now));
    newer.learn(3, version + 1);
    BOOST_TEST(newer.may_fetch(3, now));
    now += 200ms;
    BOOST_TEST(newer.may_fetch(2, now));
}

BOOST_AUTO_TEST_CASE(of_a_removed_member_nothing_is_known) {
    newer.learn(2, version + 9);
    cars.remove(2);
    static_cast<void>(known.offer(cars.authority.newest().line()));
    BOOST_TEST(!newer.has(2));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace newer_rosters
