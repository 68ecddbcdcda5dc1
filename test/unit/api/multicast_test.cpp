// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/multicast.hpp>

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(multicast)

namespace {

std::string refusal(const std::string& text) {
    try {
        cles::parse_multicast(text);
    } catch (const cles::error& e) {
        BOOST_TEST((e.code() == cles::errc::invalid_url));
        return e.message();
    }
    return {};
}

} // namespace

BOOST_AUTO_TEST_CASE(it_is_off_by_default_and_for_off) {
    BOOST_TEST(!cles::multicast_options{}.is_on());
    BOOST_TEST(!cles::parse_multicast("off").is_on());
}

BOOST_AUTO_TEST_CASE(an_interface_alone_uses_the_group_of_the_protocol) {
    const auto where = cles::parse_multicast("eth0");
    BOOST_TEST(where.interface == "eth0");
    BOOST_TEST(where.group == "239.255.25.37");
    BOOST_TEST(where.port == 25370);
}

BOOST_AUTO_TEST_CASE(group_and_port_may_be_named) {
    const auto group = cles::parse_multicast("lo,239.1.2.3");
    BOOST_TEST(group.group == "239.1.2.3");
    BOOST_TEST(group.port == 25370);
    const auto both = cles::parse_multicast("lo,239.1.2.3:4000");
    BOOST_TEST(both.interface == "lo");
    BOOST_TEST(both.group == "239.1.2.3");
    BOOST_TEST(both.port == 4000);
}

BOOST_AUTO_TEST_CASE(the_error_names_what_is_wrong) {
    BOOST_TEST(refusal("lo,10.0.0.1").find("'10.0.0.1' is not an IPv4 multicast group") == 0U);
    BOOST_TEST(refusal("lo,ff02::1").find("'ff02' is not") == 0U);
    BOOST_TEST(refusal("lo,239.1.2.3:0").find("'0' in 'lo,239.1.2.3:0' is not a port") == 0U);
    BOOST_TEST(refusal("lo,239.1.2.3:70000").find("'70000'") == 0U);
    BOOST_TEST(refusal("lo,239.1.2.3:").find("''") == 0U);
    BOOST_TEST(refusal("").find("'' does not begin with an interface") == 0U);
    BOOST_TEST(refusal(",239.1.2.3").find("',239.1.2.3' does not begin with an interface") == 0U);
}

BOOST_AUTO_TEST_CASE(several_interfaces_are_allowed) {
    using list = std::vector<std::string>;
    const auto of = [](const std::string& text) { return cles::interfaces_of(cles::parse_multicast(text)); };
    BOOST_TEST(of("lo,eth0") == (list{"lo", "eth0"}), boost::test_tools::per_element());
    BOOST_TEST(of("lo") == list{"lo"}, boost::test_tools::per_element());
    BOOST_TEST(of("off").empty());
    const auto where = cles::parse_multicast("lo,eth0.7,wlan0,239.1.2.3:4000");
    BOOST_TEST(where.interface == "lo,eth0.7,wlan0");
    BOOST_TEST(where.group == "239.1.2.3");
    BOOST_TEST(where.port == 4000);
    BOOST_TEST(of("1,2,3,4,5,6,7,8,239.1.2.3").size() == 8U);
}

BOOST_AUTO_TEST_CASE(auto_selects_interfaces_of_this_host) {
    const auto where = cles::parse_multicast("auto,239.1.2.3");
    BOOST_TEST(where.interface == "auto");
    BOOST_TEST(where.group == "239.1.2.3");
    BOOST_TEST(cles::interfaces_of(where).size() <= cles::multicast_options::most_interfaces);
}

BOOST_AUTO_TEST_CASE(invalid_lists_of_interfaces_are_refused) {
    BOOST_TEST(refusal("lo,") == "'lo,' has an empty name of an interface");
    BOOST_TEST(refusal("lo,,eth0,239.1.2.3") == "'lo,,eth0' has an empty name of an interface");
    BOOST_TEST(refusal("lo,eth0,lo") == "'lo,eth0,lo' names 'lo' twice");
    BOOST_TEST(refusal("lo,auto") == "'lo,auto' combines 'auto' with other names");
    BOOST_TEST(refusal("off,lo").find("combines 'off' with other names") != std::string::npos);
    BOOST_TEST(refusal("a,b,c,d,e,f,g,h,i") == "'a,b,c,d,e,f,g,h,i' names 9 interfaces: at most 8 are allowed");
    BOOST_CHECK_THROW(cles::check({.interface = "lo,lo"}), cles::error);
}

BOOST_AUTO_TEST_CASE(options_set_as_members_are_checked_too) {
    cles::multicast_options where{.interface = "lo", .group = "nonsense"};
    BOOST_CHECK_THROW(cles::check(where), cles::error);
    where = {.interface = "lo", .port = 0};
    BOOST_CHECK_THROW(cles::check(where), cles::error);
}

BOOST_AUTO_TEST_SUITE_END()
