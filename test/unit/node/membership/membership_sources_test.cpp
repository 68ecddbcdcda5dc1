// SPDX-License-Identifier: BSL-1.0
// Nodes that announce themselves on several interfaces (docs/protocol.md, "Membership").
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace membership_sources {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;

constexpr group_source loopback{0x7F000001, 39000};
constexpr group_source first{0x0A000007, 40000};
constexpr group_source second{0x0A010007, 41000};
constexpr group_source forger{0x0A000009, 42000};

struct fixture : cles::test::watched_membership {
    fixture() {
        table.set_prober([this](std::uint64_t, std::string_view url) { asked.emplace_back(url); });
    }

    static announcement make_announcement(std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = "car1", .endpoints = {std::move(endpoint)}, .sources = {loopback, first, second}};
    }
    verdict receive(std::uint64_t seq, const group_source& from, const announcement& said = make_announcement(),
                    std::uint32_t epoch = 1) {
        return table.apply_announcement(said, epoch, seq, from, clock.now());
    }

    std::vector<std::string> asked;
};

} // namespace
} // namespace membership_sources

BOOST_FIXTURE_TEST_SUITE(membership_sources, fixture)

BOOST_AUTO_TEST_CASE(node_received_by_two_interfaces_is_one_node_at_the_first_address) {
    for (std::uint64_t seq = 1; seq < 10; ++seq) {
        const auto& sooner = seq % 2 == 1 ? first : second; // which of them it is, is chance
        const auto& later = seq % 2 == 1 ? second : first;
        BOOST_TEST((receive(seq, sooner) == verdict::taken));
        BOOST_TEST((receive(seq, later) == verdict::duplicate));
        BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
        pass(1s);
    }
    BOOST_TEST(list().size() == 1U);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
    BOOST_TEST(asked.empty()); // it is not a name conflict
}

BOOST_AUTO_TEST_CASE(new_endpoints_count_even_if_the_other_interface_delivers_them_first) {
    receive(1, first);
    pass(1s);
    const auto moved = make_announcement("tcp://0.0.0.0:2");
    BOOST_TEST((receive(2, second, moved) == verdict::taken));
    BOOST_TEST((receive(2, first, moved) == verdict::duplicate));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:2");
}

BOOST_AUTO_TEST_CASE(announcement_may_arrive_only_by_the_other_interface) {
    receive(1, first);
    pass(1s);
    BOOST_TEST((receive(2, second) == verdict::taken));
    BOOST_TEST((receive(1, second) == verdict::old));
    pass(3s);
    BOOST_TEST((list()[0].state == cles::peer_state::live));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(other_interface_is_used_when_the_first_is_silent) {
    receive(1, first);
    take_changes();
    std::uint64_t seq = 1;
    for (; seq < 4; ++seq) {
        pass(1s);
        receive(seq + 1, second);
    }
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    pass(500ms);
    receive(seq + 1, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    check(take_changes(), {"car1 moved tcp://10.1.0.7:1"});
    pass(1s);
    receive(seq + 2, first); // it returns, which is no reason to move again
    receive(seq + 2, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
}

BOOST_AUTO_TEST_CASE(loopback_is_used_on_this_host) {
    receive(1, first);
    BOOST_TEST((receive(1, loopback, make_announcement("unix://@car1")) == verdict::duplicate));
    BOOST_TEST(where("car1") == "unix://@car1");
    check(take_changes(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved unix://@car1"});
    pass(1s);
    receive(2, first);
    receive(2, loopback, make_announcement("unix://@car1"));
    BOOST_TEST(where("car1") == "unix://@car1");
    BOOST_TEST(changes.empty());
}

BOOST_AUTO_TEST_CASE(interface_without_usable_endpoints_is_not_used) {
    receive(1, first, make_announcement("tcp://127.0.0.1:1")); // not usable from here
    BOOST_TEST(where("car1").empty());
    receive(1, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    receive(1, loopback, make_announcement("inproc://car1"));
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
}

BOOST_AUTO_TEST_CASE(unannounced_source_is_another_incarnation) {
    receive(1, first);
    pass(100ms);
    auto forged = make_announcement("tcp://0.0.0.0:9");
    forged.sources = {first, forger};
    receive(7, forger, forged);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    check(asked, {"tcp://10.0.0.9:9"}); // whether it has moved there, its answer shows
    BOOST_TEST((receive(2, second) == verdict::taken));
    BOOST_TEST(table.announced("car1")->sends_from(second));
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
}

BOOST_AUTO_TEST_CASE(announced_source_counts_only_for_its_own_name) {
    receive(1, first);
    table.apply_announcement({.node = "evil", .sources = {forger, first}}, 2, 1, forger, clock.now());
    BOOST_TEST(table.announced("evil")->sends_from(first));
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
    auto leave = make_announcement();
    leave.leaving = true;
    receive(9, forger, leave);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(leaves_once) {
    receive(1, first);
    receive(1, second);
    auto leave = make_announcement();
    leave.leaving = true;
    BOOST_TEST((receive(2, second, leave) == verdict::taken));
    BOOST_TEST((receive(2, first, leave) == verdict::old));
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST((receive(1, first) == verdict::old));
}

BOOST_AUTO_TEST_CASE(next_incarnation_is_one_node_too) {
    receive(1, first);
    pass(3s);
    auto next = make_announcement();
    next.sources = {{0x0A000007, 50000}, {0x0A010007, 51000}};
    receive(1, next.sources[1], next, 2);
    receive(1, next.sources[0], next, 2);
    BOOST_TEST(asked.size() == 1U);
    pass(500ms); // the first incarnation is silent
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    receive(2, next.sources[0], next, 2);
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(gossip_cannot_declare_sources) {
    receive(1, first);
    auto report = make_announcement();
    report.sources = {forger};
    pass(1s);
    table.apply_gossip({.announced = report, .epoch = 1, .seq = 2}, cles::core::observed_source::of(forger),
                       clock.now(), clock.now());
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
    BOOST_TEST(table.announced("car1")->sends_from(second));
}

BOOST_AUTO_TEST_SUITE_END()
