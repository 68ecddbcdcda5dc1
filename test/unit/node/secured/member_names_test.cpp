// SPDX-License-Identifier: BSL-1.0
// The names of members that are nodes of other pools, such as north.car3.
#include "node/session/request_checks.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace member_names {
namespace {

using cles::verb;
using cles::core::member_of;

struct fixture {
    [[nodiscard]] bool may_pull(std::string_view target) const {
        return cles::core::permits(*node.host, {.requester = "car1"}, target, verb::pull, "speed");
    }

    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
};

} // namespace
} // namespace member_names

BOOST_FIXTURE_TEST_SUITE(member_names, fixture)

BOOST_AUTO_TEST_CASE(a_node_of_another_pool_is_the_member_of_that_name) {
    BOOST_TEST(member_of(*node.host, "car3") == "car3");
    BOOST_TEST(member_of(*node.host, "north.car3") == "car3");
    BOOST_TEST(member_of(*node.host, "north.any") == "any");
    BOOST_TEST(member_of(*node.host, "north.all") == "all");
    for (const std::string_view other : {"", "any", "nobody", "north.", "north.nobody", ".", "a.north.car3", "north"}) {
        BOOST_TEST(member_of(*node.host, other) == other, other);
    }
}

BOOST_AUTO_TEST_CASE(a_members_own_name_with_a_dot_has_precedence) {
    security->members.insert("north.car3");
    BOOST_TEST(member_of(*node.host, "north.car3") == "north.car3");
    BOOST_TEST(member_of(*node.host, "south.car3") == "car3");
    BOOST_TEST(member_of(*node.host, "west.north.car3") == "north.car3");
}

BOOST_AUTO_TEST_CASE(without_security_names_have_no_meaning) {
    cles::test::test_node open;
    BOOST_TEST(member_of(*open.host, "north.car3") == "north.car3");
    BOOST_TEST(cles::core::permits(*open.host, {}, "north.nobody", verb::pull, "speed"));
}

BOOST_AUTO_TEST_CASE(the_rights_are_those_for_the_member) {
    BOOST_TEST(may_pull("north.car3"));
    security->denied = {"car1 PULL car3:speed"};
    BOOST_TEST(!may_pull("north.car3"));
    BOOST_TEST(!may_pull("car3"));
    security->members.insert("north.car3");
    BOOST_TEST(may_pull("north.car3"));
    security->denied = {"car1 PULL north.car3:speed"};
    BOOST_TEST(!may_pull("north.car3"));
    BOOST_TEST(may_pull("car3"));
}

BOOST_AUTO_TEST_CASE(a_group_of_another_pool_is_checked_there) {
    security->denied = {"car1 PULL any:speed", "car1 PULL all:speed", "car1 PULL north.nobody:speed"};
    BOOST_TEST(may_pull("north.any"));
    BOOST_TEST(may_pull("north.all"));
    BOOST_TEST(!may_pull("any"));
    BOOST_TEST(!may_pull("north.nobody")); // no member: its whole name is asked for
}

BOOST_AUTO_TEST_SUITE_END()
