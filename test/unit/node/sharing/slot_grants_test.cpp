// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/slot_grants.hpp"

#include <boost/test/unit_test.hpp>

namespace slot_grants {
namespace {

struct fixture {
    using verdict = cles::core::slot_grants::verdict;

    verdict use(std::string_view by, std::uint64_t number) {
        const auto found = grants.check(by, number, now);
        if (found == verdict::valid) {
            grants.use(by);
        }
        return found;
    }

    cles::core::slot_grants grants;
    cles::time_point now{};
};

} // namespace
} // namespace slot_grants

BOOST_FIXTURE_TEST_SUITE(slot_grants, fixture)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(each_slot_is_used_once) {
    grants.open("car2", 7, 2, 2, now);
    BOOST_TEST(grants.reserved(now) == 2U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST(grants.reserved(now) == 0U);
}

BOOST_AUTO_TEST_CASE(only_by_the_node_that_it_was_given_to) {
    grants.open("car2", 7, 1, 1, now);
    grants.open("car3", 8, 1, 1, now);
    BOOST_TEST((use("car3", 7) == verdict::unknown));
    BOOST_TEST((use("car4", 7) == verdict::unknown));
    BOOST_TEST((use("car2", 9) == verdict::unknown));
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(expires_after_50_ms) {
    grants.open("car2", 7, 1, 1, now);
    BOOST_TEST((grants.next_expiry(now) == now + 50ms));
    now += 49ms;
    BOOST_TEST((grants.check("car2", 7, now) == verdict::valid));
    now += 1ms;
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST(!grants.next_expiry(now));
}

BOOST_AUTO_TEST_CASE(what_is_not_taken_at_once_is_valid_but_not_reserved) {
    grants.open("car2", 7, 3, 3, now);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    grants.unreserve("car2", 7, 1);
    BOOST_TEST(grants.reserved(now) == 1U); // one is on its way
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
}

BOOST_AUTO_TEST_CASE(what_was_not_reserved_is_not_given_back) {
    grants.open("car2", 7, 1, 1, now);
    grants.unreserve("car2", 8, 1); // another grant
    grants.unreserve("car3", 7, 1);
    BOOST_TEST(grants.reserved(now) == 1U);
    grants.unreserve("car2", 7, 5);
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(slots_may_be_granted_without_being_reserved) {
    grants.open("car2", 7, 2, 0, now);
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST(grants.reserved_for("car2", now) == 0U);
    BOOST_TEST(!grants.next_expiry(now));
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(a_valid_grant_is_extended) {
    BOOST_TEST(grants.open("car2", 7, 2, 1, now) == 7U);
    now += 49ms;
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST(grants.open("car2", 8, 1, 1, now) == 7U);
    BOOST_TEST(grants.reserved(now) == 1U);
    now += 49ms;
    BOOST_TEST((use("car2", 8) == verdict::unknown));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
}

BOOST_AUTO_TEST_CASE(a_new_grant_follows_one_that_has_expired) {
    grants.open("car2", 7, 2, 2, now);
    now += 50ms;
    BOOST_TEST(grants.open("car2", 8, 1, 1, now) == 8U);
    BOOST_TEST(grants.reserved(now) == 1U);
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST((use("car2", 8) == verdict::valid));
    BOOST_TEST((use("car2", 8) == verdict::over));
}

BOOST_AUTO_TEST_CASE(a_grant_has_at_most_1024_slots) {
    grants.open("car2", 7, 1000, 0, now);
    grants.open("car2", 7, 1000, 0, now);
    for (int i = 0; i < 1024; ++i) {
        BOOST_TEST_REQUIRE((use("car2", 7) == verdict::valid));
    }
    BOOST_TEST((use("car2", 7) == verdict::over));
}

BOOST_AUTO_TEST_CASE(nothing_is_known_of_a_node_that_is_forgotten) {
    grants.open("car2", 7, 2, 2, now);
    BOOST_TEST(grants.reserved_for("car2", now) == 2U);
    grants.forget("car2");
    BOOST_TEST(grants.reserved_for("car2", now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::unknown));
}

BOOST_AUTO_TEST_SUITE_END()
