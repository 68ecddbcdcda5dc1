// SPDX-License-Identifier: BSL-1.0
#include <cles/url.hpp>

#include "discovery/host.hpp"
#include "discovery/stated_endpoints.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include <ifaddrs.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace stated_endpoints {
namespace {

using texts = std::vector<std::string>;

// Addresses for documentation, which no host has.
constexpr auto far_v4 = "tcp://192.0.2.7:25370";
constexpr auto far_v6 = "tcp://[2001:db8::7]:25370";

std::string bytes(std::initializer_list<unsigned char> of) { return std::string(of.begin(), of.end()); }

std::string far_v6_bytes() { return bytes({0x20, 0x01, 0x0d, 0xb8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7}); }

ifaddrs* first_interface_address() {
    ifaddrs* first = nullptr;
    BOOST_REQUIRE(::getifaddrs(&first) == 0);
    return first;
}

} // namespace

BOOST_AUTO_TEST_SUITE(stated_endpoints)

BOOST_AUTO_TEST_CASE(all_addresses_become_the_one_asked_of_the_same_family) {
    const texts stated{"tcp://[::]:1", "tcp://0.0.0.0:2", "tcp://192.0.2.9:3"};
    BOOST_TEST(
        (tool::endpoints_from_here(far_v4, stated) == texts{"tcp://192.0.2.7:2", "tcp://192.0.2.9:3", "tcp://[::]:1"}));
    BOOST_TEST((tool::endpoints_from_here(far_v6, stated) ==
                texts{"tcp://[2001:db8::7]:1", "tcp://192.0.2.9:3", "tcp://0.0.0.0:2"}));
}

BOOST_AUTO_TEST_CASE(on_this_host_they_stay) {
    const texts stated{"tcp://0.0.0.0:2", "unix://@car1"};
    for (const auto* const asked : {"tcp://127.0.0.1", "tcp://[::1]:2", "unix://@car1", "tcp://0.0.0.0:2"}) {
        BOOST_TEST((tool::endpoints_from_here(asked, stated) == stated), asked);
        BOOST_TEST((tool::known_endpoints_from_here(asked, stated) == stated), asked);
    }
}

BOOST_AUTO_TEST_CASE(an_address_leads_here_if_an_interface_has_it) {
    const tool::host_addresses own{bytes({192, 0, 2, 1}), bytes({192, 0, 2, 9}), far_v6_bytes()};
    BOOST_TEST(tool::leads_here({bytes({192, 0, 2, 1})}, own));
    BOOST_TEST(tool::leads_here({bytes({192, 0, 2, 9})}, own)); // also the second one
    BOOST_TEST(tool::leads_here({bytes({192, 0, 2, 7}), far_v6_bytes()}, own));
    BOOST_TEST(!tool::leads_here({bytes({192, 0, 2, 7})}, own));
    BOOST_TEST(!tool::leads_here({}, own));
    BOOST_TEST(tool::leads_here({bytes({127, 3, 2, 1})}, {}));
    BOOST_TEST(tool::leads_here({bytes({0, 0, 0, 0})}, {}));
    BOOST_TEST(!tool::leads_here({bytes({192, 0, 2, 1})}, {})); // it had that address before
}

BOOST_AUTO_TEST_CASE(the_addresses_of_a_host_are_those_that_it_has) {
    BOOST_TEST((tool::addresses_of("192.0.2.9") == tool::host_addresses{bytes({192, 0, 2, 9})}));
    BOOST_TEST((tool::addresses_of("2001:db8::7") == tool::host_addresses{far_v6_bytes()}));
    const auto own = tool::own_addresses();
    BOOST_TEST((std::find(own.begin(), own.end(), bytes({127, 0, 0, 1})) != own.end()));
}

BOOST_AUTO_TEST_CASE(each_address_and_name_of_this_host_leads_here) {
    const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all{first_interface_address(), &::freeifaddrs};
    std::vector<std::string> hosts{"localhost", "127.0.0.1", "::1", "0.0.0.0", "::"};
    for (const auto* entry = all.get(); entry != nullptr; entry = entry->ifa_next) { // also those after the first
        std::array<char, NI_MAXHOST> text{};
        const auto family = entry->ifa_addr == nullptr ? AF_UNSPEC : entry->ifa_addr->sa_family;
        const socklen_t size = family == AF_INET    ? socklen_t{sizeof(sockaddr_in)}
                               : family == AF_INET6 ? socklen_t{sizeof(sockaddr_in6)}
                                                    : socklen_t{0};
        if (size != 0 &&
            ::getnameinfo(entry->ifa_addr, size, text.data(), socklen_t{NI_MAXHOST}, nullptr, 0, NI_NUMERICHOST) == 0) {
            hosts.emplace_back(text.data());
        }
    }
    for (const auto& host : hosts) {
        cles::url at;
        at.scheme = "tcp";
        at.host = host;
        BOOST_REQUIRE_NO_THROW(cles::parse_url(to_string(at))); // else it would not be looked at
        BOOST_TEST(!tool::is_elsewhere(to_string(at)), host);
    }
    BOOST_TEST(tool::is_elsewhere(far_v4));
    BOOST_TEST(tool::is_elsewhere(far_v6));
    BOOST_TEST(!tool::is_elsewhere("unix://@car1"));
}

BOOST_AUTO_TEST_CASE(what_is_of_use_there_only_follows_or_is_left_out) {
    const texts stated{"unix://@car1", "tcp://127.0.0.1:1", "tcp://192.0.2.7:2"};
    BOOST_TEST(
        (tool::endpoints_from_here(far_v4, stated) == texts{"tcp://192.0.2.7:2", "unix://@car1", "tcp://127.0.0.1:1"}));
    BOOST_TEST((tool::known_endpoints_from_here(far_v4, stated) == texts{"tcp://192.0.2.7:2"}));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace stated_endpoints
