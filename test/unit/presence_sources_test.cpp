// SPDX-License-Identifier: BSL-1.0
// Nodes that take part in multicast by several interfaces (docs/protocol.md, "Membership").
#include "core/presence.hpp"
#include "support/watched_presence.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace presence_sources {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;

constexpr group_source loopback{0x7F000001, 39000};
constexpr group_source first{0x0A000007, 40000};
constexpr group_source second{0x0A010007, 41000};
constexpr group_source forger{0x0A000009, 42000};

struct fixture : cles::test::watched_presence, cles::core::presence::prober {
    fixture() { table.probe_by(this); }
    void probe(std::uint64_t, std::string_view url) override { asked.emplace_back(url); }

    static announcement saying(std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = "car1", .endpoints = {std::move(endpoint)}, .sources = {loopback, first, second}};
    }
    verdict hear(std::uint64_t seq, const group_source& from, const announcement& said = saying(),
                 std::uint32_t epoch = 1) {
        return table.hear(said, epoch, seq, from, clock.now());
    }

    std::vector<std::string> asked;
};

} // namespace
} // namespace presence_sources

BOOST_FIXTURE_TEST_SUITE(presence_sources, fixture)

BOOST_AUTO_TEST_CASE(a_node_heard_by_two_interfaces_is_one_node_asked_by_the_first) {
    for (std::uint64_t seq = 1; seq < 10; ++seq) {
        const auto& sooner = seq % 2 == 1 ? first : second; // which of them is, is chance
        const auto& later = seq % 2 == 1 ? second : first;
        BOOST_TEST((hear(seq, sooner) == verdict::taken));
        BOOST_TEST((hear(seq, later) == verdict::again));
        BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
        pass(1s);
    }
    BOOST_TEST(list().size() == 1U);
    check(told, {"car1 appeared tcp://10.0.0.7:1"});
    BOOST_TEST(asked.empty()); // it is no clash
}

BOOST_AUTO_TEST_CASE(new_endpoints_count_though_they_come_by_the_other_interface_first) {
    hear(1, first);
    pass(1s);
    const auto moved = saying("tcp://0.0.0.0:2");
    BOOST_TEST((hear(2, second, moved) == verdict::taken));
    BOOST_TEST((hear(2, first, moved) == verdict::again));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:2");
}

BOOST_AUTO_TEST_CASE(what_it_says_by_the_other_interface_may_be_the_only_one_that_comes) {
    hear(1, first);
    pass(1s);
    BOOST_TEST((hear(2, second) == verdict::taken));
    BOOST_TEST((hear(1, second) == verdict::old));
    pass(3s);
    BOOST_TEST((list()[0].state == cles::peer_state::live));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(it_is_asked_by_the_other_interface_when_the_first_is_silent) {
    hear(1, first);
    take_told();
    std::uint64_t seq = 1;
    for (; seq < 4; ++seq) {
        pass(1s);
        hear(seq + 1, second);
    }
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    pass(500ms);
    hear(seq + 1, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    check(take_told(), {"car1 moved tcp://10.1.0.7:1"});
    pass(1s);
    hear(seq + 2, first); // it is back, and that is no reason to move again
    hear(seq + 2, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
}

BOOST_AUTO_TEST_CASE(on_this_host_it_is_asked_by_loopback) {
    hear(1, first);
    BOOST_TEST((hear(1, loopback, saying("unix://@car1")) == verdict::again));
    BOOST_TEST(where("car1") == "unix://@car1");
    check(take_told(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved unix://@car1"});
    pass(1s);
    hear(2, first);
    hear(2, loopback, saying("unix://@car1"));
    BOOST_TEST(where("car1") == "unix://@car1");
    BOOST_TEST(told.empty());
}

BOOST_AUTO_TEST_CASE(an_interface_by_which_it_cannot_be_asked_does_not_lead_to_it) {
    hear(1, first, saying("tcp://127.0.0.1:1")); // of no use from here
    BOOST_TEST(where("car1").empty());
    hear(1, second);
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    hear(1, loopback, saying("inproc://car1"));
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
}

BOOST_AUTO_TEST_CASE(a_source_that_it_has_not_announced_is_another_run) {
    hear(1, first);
    pass(100ms);
    auto forged = saying("tcp://0.0.0.0:9");
    forged.sources = {first, forger};
    hear(7, forger, forged);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    check(asked, {"tcp://10.0.0.7:1"}); // the owner is asked whether it is there
    BOOST_TEST((hear(2, second) == verdict::taken));
    BOOST_TEST(table.announced("car1")->sends_from(second));
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
}

BOOST_AUTO_TEST_CASE(a_source_is_its_own_for_its_name_alone) {
    hear(1, first);
    table.hear({.node = "evil", .sources = {forger, first}}, 2, 1, forger, clock.now());
    BOOST_TEST(table.announced("evil")->sends_from(first));
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
    auto farewell = saying();
    farewell.leaving = true;
    hear(9, forger, farewell);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(it_leaves_once) {
    hear(1, first);
    hear(1, second);
    auto farewell = saying();
    farewell.leaving = true;
    BOOST_TEST((hear(2, second, farewell) == verdict::taken));
    BOOST_TEST((hear(2, first, farewell) == verdict::old));
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST((hear(1, first) == verdict::old));
}

BOOST_AUTO_TEST_CASE(the_next_run_of_it_is_one_too) {
    hear(1, first);
    pass(3s);
    auto next = saying();
    next.sources = {{0x0A000007, 50000}, {0x0A010007, 51000}};
    hear(1, next.sources[1], next, 2);
    hear(1, next.sources[0], next, 2);
    BOOST_TEST(asked.size() == 1U);
    pass(500ms); // the first one is silent
    BOOST_TEST(where("car1") == "tcp://10.1.0.7:1");
    hear(2, next.sources[0], next, 2);
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_others_tell_declares_no_source) {
    hear(1, first);
    auto report = saying();
    report.sources = {forger};
    pass(1s);
    table.be_told({.said = report, .epoch = 1, .seq = 2}, cles::core::teller::of(forger), clock.now(), clock.now());
    BOOST_TEST(!table.announced("car1")->sends_from(forger));
    BOOST_TEST(table.announced("car1")->sends_from(second));
}

BOOST_AUTO_TEST_SUITE_END()
