// SPDX-License-Identifier: BSL-1.0
// On which interfaces a node is in its group, while they come, change and go.
#include "node/publish/group_interfaces.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace group_interfaces {
namespace {

using namespace std::chrono_literals;
using chosen = cles::core::group_interfaces;
using interface = cles::core::network_interface;
using texts = std::vector<std::string>;

cles::multicast_options on(std::string interfaces) { return {.interface = std::move(interfaces)}; }

interface card(const std::string& name, int index, std::uint32_t address) {
    return {.name = name, .index = index, .address = address, .up = true, .running = true, .multicast = true};
}

interface loopback() {
    auto lo = card("lo", 1, 0x7F000001);
    lo.loopback = true;
    lo.multicast = false;
    return lo;
}

texts names_of(const std::vector<interface>& all) {
    texts names;
    for (const auto& each : all) {
        names.push_back(each.name);
    }
    return names;
}

void check(const texts& found, const texts& expected) {
    BOOST_TEST(found == expected, boost::test_tools::per_element());
}

struct fixture {
    /// Compares, and does what is to be done.
    void look(const std::vector<interface>& all) {
        const auto steps = of.compare(all);
        left = names_of(steps.leave);
        joined = names_of(steps.join);
        left_out = steps.left_out;
        for (const auto& each : steps.join) {
            of.on_joined(each);
        }
    }

    cles::test::manual_clock clock;
    chosen of{on("auto")};
    texts left;
    texts joined;
    texts left_out;
};

} // namespace
} // namespace group_interfaces

BOOST_FIXTURE_TEST_SUITE(group_interfaces, fixture)

BOOST_AUTO_TEST_CASE(an_interface_is_joined_when_it_gets_its_address) {
    look({loopback(), card("eth0", 2, 0)});
    check(joined, {"lo"});
    look({loopback(), card("eth0", 2, 0x0A500001)});
    check(joined, {"eth0"});
    check(left, {});
    look({loopback(), card("eth0", 2, 0x0A500001)});
    check(joined, {});
}

BOOST_AUTO_TEST_CASE(an_interface_with_another_address_is_joined_anew) {
    look({loopback(), card("eth0", 2, 0x0A500001)});
    look({loopback(), card("eth0", 2, 0x0A50004D)});
    check(left, {"eth0"});
    check(joined, {"eth0"});
    BOOST_TEST(of.joined().size() == 2U);
}

BOOST_AUTO_TEST_CASE(an_interface_that_was_made_anew_is_joined_anew) {
    look({card("eth0", 2, 0x0A500001)});
    look({card("eth0", 7, 0x0A500001)});
    check(left, {"eth0"});
    check(joined, {"eth0"});
}

BOOST_AUTO_TEST_CASE(an_interface_without_address_is_left_and_joined_when_it_has_one_again) {
    look({loopback(), card("eth0", 2, 0x0A500001)});
    look({loopback(), card("eth0", 2, 0)});
    check(left, {"eth0"});
    check(joined, {});
    look({loopback()});
    check(left, {});
    look({loopback(), card("eth0", 3, 0x0A500001)});
    check(joined, {"eth0"});
}

BOOST_AUTO_TEST_CASE(an_interface_without_link_stays_joined) {
    look({loopback(), card("eth0", 2, 0x0A500001)});
    auto cut = card("eth0", 2, 0x0A500001);
    cut.running = false;
    look({loopback(), cut});
    check(left, {});
    cut.up = false;
    look({loopback(), cut});
    check(left, {});
    look({loopback(), card("eth0", 2, 0x0A500001)});
    check(joined, {});
}

BOOST_AUTO_TEST_CASE(only_interfaces_that_are_named_are_joined) {
    of = chosen{on("eth1,eth0")};
    look({loopback(), card("eth0", 2, 0x0A500001), card("eth2", 3, 0x0A510001)});
    check(joined, {"eth0"});
    auto down = card("eth1", 4, 0x0A520001);
    down.up = down.running = false;
    look({card("eth0", 2, 0x0A500001), down});
    check(joined, {});
    down.up = true; // a link is not needed
    look({card("eth0", 2, 0x0A500001), down});
    check(joined, {"eth1"});
    check(left, {});
}

BOOST_AUTO_TEST_CASE(no_more_than_the_limit_are_joined) {
    std::vector<interface> all{loopback()};
    for (int index = 2; index <= 10; ++index) {
        all.push_back(card("eth" + std::to_string(index), index, 0x0A500000U + static_cast<std::uint32_t>(index)));
    }
    look(all);
    BOOST_TEST(joined.size() == cles::multicast_options::most_interfaces);
    check(left_out, {"eth9", "eth10"});
    all.erase(all.begin() + 1);
    look(all);
    check(left, {"eth2"});
    check(joined, {"eth9"});
    check(left_out, {"eth10"});
}

BOOST_AUTO_TEST_CASE(changes_are_acted_on_when_they_have_settled) {
    BOOST_TEST(!of.due());
    const auto start = clock.now();
    of.on_change(start);
    BOOST_TEST((of.due() == start + chosen::settling));
    of.on_change(start + 150ms);
    BOOST_TEST((of.due() == start + 150ms + chosen::settling));
    for (auto at = 150ms; at < 2s; at += 150ms) { // an interface that does not come to rest
        of.on_change(start + at);
    }
    BOOST_TEST((of.due() == start + chosen::longest_settling));
    look({loopback()});
    BOOST_TEST(!of.due());
    of.on_change(start + 3s);
    BOOST_TEST((of.due() == start + 3s + chosen::settling));
}

BOOST_AUTO_TEST_CASE(what_has_failed_is_tried_again_with_growing_pauses) {
    const auto eth0 = card("eth0", 2, 0x0A500001);
    auto now = clock.now();
    BOOST_TEST(names_of(of.compare({eth0}).join).size() == 1U);
    BOOST_TEST(of.on_failed(eth0, true, now));
    for (auto pause = chosen::first_retry; pause < chosen::longest_retry; pause *= 2) {
        BOOST_TEST((of.due() == now + pause));
        now += pause;
        BOOST_TEST(names_of(of.compare({eth0}).join).size() == 1U);
        BOOST_TEST(!of.on_failed(eth0, true, now)); // known
    }
    BOOST_TEST((of.due() == now + chosen::longest_retry));
    of.on_change(now); // something is different: the pauses begin anew
    BOOST_TEST((of.due() == now + chosen::settling));
    BOOST_TEST(names_of(of.compare({eth0}).join).size() == 1U);
    of.on_failed(eth0, true, now);
    BOOST_TEST((of.due() == now + chosen::first_retry));
    of.compare({eth0}).join.clear();
    of.on_joined(eth0);
    BOOST_TEST(!of.due());
}

BOOST_AUTO_TEST_CASE(what_is_forbidden_is_not_tried_again_without_a_change) {
    const auto eth0 = card("eth0", 2, 0x0A500001);
    const auto now = clock.now();
    BOOST_TEST(of.compare({eth0}).join.size() == 1U);
    BOOST_TEST(of.on_failed(eth0, false, now));
    BOOST_TEST(!of.due());
    BOOST_TEST(of.compare({eth0}).join.size() == 1U);
    BOOST_TEST(!of.on_failed(eth0, false, now));
    BOOST_TEST(of.compare({}).join.empty()); // it is gone, and comes again
    BOOST_TEST(of.compare({eth0}).join.size() == 1U);
    BOOST_TEST(of.on_failed(eth0, false, now));
}

BOOST_AUTO_TEST_CASE(a_list_that_cannot_be_read_is_read_again) {
    of.on_unlisted(clock.now());
    BOOST_TEST((of.due() == clock.now() + chosen::first_retry));
}

BOOST_AUTO_TEST_SUITE_END()
