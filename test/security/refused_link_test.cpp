// SPDX-License-Identifier: BSL-1.0
#include "security/refused_link.hpp"

#include <boost/test/unit_test.hpp>

#include <set>
#include <string_view>

BOOST_AUTO_TEST_SUITE(refused_link)

BOOST_AUTO_TEST_CASE(the_line_names_the_address_and_the_key) {
    using cles::security::text_of;
    BOOST_TEST(text_of({.source = "10.0.0.7", .why = "a", .key = "nJ3"}) == "a (10.0.0.7, key nJ3)");
    BOOST_TEST(text_of({.source = "10.0.0.7", .why = "a"}) == "a (10.0.0.7)");
    BOOST_TEST(text_of({.why = "a", .key = "nJ3"}) == "a (key nJ3)");
    BOOST_TEST(text_of({.why = "a"}) == "a");
}

// So strangers do not silence what concerns a removed member.
BOOST_AUTO_TEST_CASE(each_reason_is_a_kind_of_its_own) {
    using reason = cles::security::link_admission::reason;
    std::set<std::string_view> kinds;
    for (const auto why : {reason::none, reason::protocol, reason::not_member, reason::removed, reason::other_name,
                           reason::by_peer, reason::busy}) {
        kinds.insert(cles::security::log_kind_of(why));
    }
    BOOST_TEST(kinds.size() == 7U);
}

BOOST_AUTO_TEST_SUITE_END()
