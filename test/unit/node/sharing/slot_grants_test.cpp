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
            grants.arrived(by, number, now);
            grants.use(by);
        }
        return found;
    }

    /// Opens a grant, or renews it, with slots that are reserved for as long as it is valid.
    std::uint64_t open(const char* to, std::uint64_t number, unsigned slots, unsigned reserved) {
        const auto given = grants.open(to, number, slots, now);
        grants.reserve(to, reserved, now + cles::core::slot_grants::valid_for, now);
        return given;
    }

    cles::core::slot_grants grants;
    cles::time_point now{};
};

} // namespace
} // namespace slot_grants

BOOST_FIXTURE_TEST_SUITE(slot_grants, fixture)

using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(each_slot_is_used_once) {
    open("car2", 7, 2, 2);
    BOOST_TEST(grants.reserved(now) == 2U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST(grants.reserved(now) == 0U);
}

BOOST_AUTO_TEST_CASE(only_by_the_node_that_it_was_given_to) {
    open("car2", 7, 1, 1);
    open("car3", 8, 1, 1);
    BOOST_TEST((use("car3", 7) == verdict::unknown));
    BOOST_TEST((use("car4", 7) == verdict::unknown));
    BOOST_TEST((use("car2", 9) == verdict::unknown));
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(expires_after_50_ms) {
    open("car2", 7, 1, 1);
    BOOST_TEST((grants.next_expiry(now) == now + 50ms));
    now += 49ms;
    BOOST_TEST((grants.check("car2", 7, now) == verdict::valid));
    now += 1ms;
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST(!grants.next_expiry(now));
}

BOOST_AUTO_TEST_CASE(what_is_not_taken_at_once_is_valid_but_not_reserved) {
    open("car2", 7, 3, 3);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    grants.unreserve("car2", 7, 1);
    BOOST_TEST(grants.reserved(now) == 1U); // one is on its way
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
}

BOOST_AUTO_TEST_CASE(what_was_not_reserved_is_not_given_back) {
    open("car2", 7, 1, 1);
    grants.unreserve("car2", 8, 1); // another grant
    grants.unreserve("car3", 7, 1);
    BOOST_TEST(grants.reserved(now) == 1U);
    grants.unreserve("car2", 7, 5);
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(slots_may_be_granted_without_being_reserved) {
    open("car2", 7, 2, 0);
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST(!grants.next_expiry(now));
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(a_valid_grant_is_extended) {
    BOOST_TEST(open("car2", 7, 2, 1) == 7U);
    now += 49ms;
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST(open("car2", 8, 1, 1) == 7U);
    BOOST_TEST(grants.reserved(now) == 1U);
    now += 49ms;
    BOOST_TEST((use("car2", 8) == verdict::unknown));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST((use("car2", 7) == verdict::over));
}

// Otherwise a slot that is never used would be kept for as long as the grant is renewed.
BOOST_AUTO_TEST_CASE(a_renewal_does_not_prolong_what_was_reserved_before) {
    open("car2", 7, 1, 1);
    now += 30ms;
    BOOST_TEST(grants.open("car2", 8, 1, now) == 7U);
    grants.reserve("car2", 1, now + 5ms, now);
    BOOST_TEST(grants.reserved(now) == 2U);
    BOOST_TEST((grants.next_expiry(now) == now + 5ms));
    now += 5ms;
    BOOST_TEST(grants.reserved(now) == 1U);
    now += 15ms;
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid)); // they are valid all the same
    BOOST_TEST((use("car2", 7) == verdict::valid));
}

BOOST_AUTO_TEST_CASE(nothing_is_reserved_for_a_job_that_has_come_even_if_it_is_refused) {
    open("car2", 7, 2, 2);
    grants.arrived("car2", 6, now); // on another grant
    BOOST_TEST(grants.reserved(now) == 2U);
    grants.arrived("car2", 7, now);
    BOOST_TEST(grants.reserved(now) == 1U);
    BOOST_TEST((use("car2", 7) == verdict::valid));
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::valid)); // its slot
    grants.arrived("car3", 7, now);                 // has no grant
}

BOOST_AUTO_TEST_CASE(a_new_grant_follows_one_that_has_expired) {
    open("car2", 7, 2, 2);
    now += 50ms;
    BOOST_TEST(open("car2", 8, 1, 1) == 8U);
    BOOST_TEST(grants.reserved(now) == 1U);
    BOOST_TEST((use("car2", 7) == verdict::over));
    BOOST_TEST((use("car2", 8) == verdict::valid));
    BOOST_TEST((use("car2", 8) == verdict::over));
}

BOOST_AUTO_TEST_CASE(a_grant_has_at_most_1024_slots) {
    open("car2", 7, 1000, 0);
    open("car2", 7, 1000, 0);
    for (int i = 0; i < 1024; ++i) {
        BOOST_TEST_REQUIRE((use("car2", 7) == verdict::valid));
    }
    BOOST_TEST((use("car2", 7) == verdict::over));
}

BOOST_AUTO_TEST_CASE(nothing_is_known_of_a_node_that_is_forgotten) {
    open("car2", 7, 2, 2);
    BOOST_TEST(grants.reserved(now) == 2U);
    grants.forget("car2");
    BOOST_TEST(grants.reserved(now) == 0U);
    BOOST_TEST((use("car2", 7) == verdict::unknown));
}

BOOST_AUTO_TEST_SUITE_END()
