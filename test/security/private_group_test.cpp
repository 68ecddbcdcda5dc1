// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/file_protection.hpp"

#include <boost/test/unit_test.hpp>

namespace private_group {
namespace {

using cles::security::group_entry;
using cles::security::is_private_group;
using cles::security::user_entry;

const user_entry alice{.name = "alice", .group = 1000};
const user_entry bob{.name = "bob", .group = 1001};

} // namespace

BOOST_AUTO_TEST_SUITE(private_group)

BOOST_AUTO_TEST_CASE(the_group_of_one_user) {
    BOOST_TEST(is_private_group({.name = "alice", .id = 1000}, alice, {alice, bob}));
    BOOST_TEST(is_private_group({.name = "alice", .id = 1000, .members = {"alice"}}, alice, {alice, bob}));
    BOOST_TEST(is_private_group({.name = "alice", .id = 1000}, alice, {})); // not every system lists its users
}

BOOST_AUTO_TEST_CASE(a_group_with_another_member) {
    BOOST_TEST(!is_private_group({.name = "alice", .id = 1000, .members = {"bob"}}, alice, {alice, bob}));
    BOOST_TEST(!is_private_group({.name = "alice", .id = 1000, .members = {"alice", "bob"}}, alice, {alice, bob}));
}

BOOST_AUTO_TEST_CASE(a_group_that_is_the_primary_one_of_another) {
    const user_entry guest{.name = "guest", .group = 1000};
    BOOST_TEST(!is_private_group({.name = "alice", .id = 1000}, alice, {alice, guest}));
}

BOOST_AUTO_TEST_CASE(a_group_of_another_name_or_of_another_user) {
    BOOST_TEST(!is_private_group({.name = "users", .id = 1000}, alice, {alice}));
    BOOST_TEST(!is_private_group({.name = "alice", .id = 100}, alice, {alice}));
    BOOST_TEST(!is_private_group({.name = "bob", .id = 1001}, alice, {alice, bob}));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace private_group
