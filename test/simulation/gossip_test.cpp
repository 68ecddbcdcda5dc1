// SPDX-License-Identifier: BSL-1.0
// Dozens of nodes, and once more than a hundred, that discover each other without multicast, in virtual time.
// `scripts/simulate gossip` simulates a thousand, for half an hour.
#include "simulation/gossip_network.hpp"
#include "simulation/seeds.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>

BOOST_AUTO_TEST_SUITE(gossip)

using namespace std::chrono_literals;
using cles::simulation::gossip_network;
using cles::simulation::gossip_weather;
using cles::simulation::planted;

namespace {

constexpr auto some = cles::simulation::gossip_nodes;
constexpr auto few = cles::simulation::gossip_few_nodes;
constexpr gossip_weather rough{.loss = 50, .paused = 20};

/// A network whose nodes have started a while ago.
struct running_network : gossip_network {
    explicit running_network(std::uint64_t seed, std::size_t nodes = some, std::size_t seeds = 3,
                             planted fault = planted::none)
        : gossip_network(seed, {}, fault) {
        start(nodes, 1s, seeds);
        pass(10s);
    }
};

} // namespace

BOOST_AUTO_TEST_CASE(a_large_network_is_whole_within_15_s_of_a_cold_start_and_then_quiet) {
    gossip_network net{1};
    net.start(cles::simulation::gossip_many_nodes, 1s);
    BOOST_TEST((net.pass_until([&] { return net.whole(); }, 15s) < 15s));
    BOOST_TEST(net.false_deaths() == 0U);
    net.pass(10s);
    net.take_received(1s);
    net.pass(15s);
    const auto bytes = net.take_received(15s);
    BOOST_TEST(bytes.average <= 20'000.0);
    BOOST_TEST(net.whole());
    BOOST_TEST(net.false_deaths() == 0U);
    BOOST_TEST(net.false_suspicions() == 0U);
    BOOST_TEST(net.clashes() == 0U);
}

BOOST_AUTO_TEST_CASE(no_live_node_is_taken_for_gone_where_packets_are_lost_and_processes_stopped) {
    gossip_network net{2, rough};
    net.start(some, 1s);
    net.pass(cles::simulation::gossip_rough_time);
    BOOST_TEST(net.false_deaths() == 0U);
    BOOST_TEST(net.clashes() == 0U);
    net.set_weather({});
    net.pass(40s);
    BOOST_TEST(net.whole());
}

BOOST_AUTO_TEST_CASE(a_network_that_was_cut_in_two_is_whole_within_15_s) {
    running_network net{3};
    BOOST_TEST(net.whole());
    net.allow([](std::size_t from, std::size_t to) { return from % 2 == to % 2; });
    net.pass(30s);
    BOOST_TEST(net.missing() == some * (some / 2)); // each half has removed the other one
    net.allow({});
    BOOST_TEST((net.pass_until([&] { return net.whole(); }, 15s) < 15s));
    BOOST_TEST(net.clashes() == 0U);
}

BOOST_AUTO_TEST_CASE(where_the_half_without_seeds_is_cut_off_it_finds_the_other_one_too) {
    running_network net{4, few, 1};
    net.allow([](std::size_t from, std::size_t to) { return (from < few / 3) == (to < few / 3); });
    net.pass(60s);
    net.allow({});
    BOOST_TEST((net.pass_until([&] { return net.whole(); }, 15s) < 15s));
}

BOOST_AUTO_TEST_CASE(nobody_is_lost_where_messages_pass_one_way_only) {
    running_network net{5};
    net.forget_verdicts();
    // One third receives from the others, but they do not receive from it; then the other way round.
    net.allow([](std::size_t from, std::size_t to) { return from % 3 != 0 || to % 3 == 0; });
    net.pass(5s);
    net.allow([](std::size_t from, std::size_t to) { return from % 3 == 0 || to % 3 != 0; });
    net.pass(5s);
    net.allow({});
    BOOST_TEST((net.pass_until([&] { return net.whole(); }, 15s) < 15s));
    BOOST_TEST(net.false_deaths() == 0U);
}

BOOST_AUTO_TEST_CASE(a_silent_death_is_noticed_everywhere_within_3_5_intervals) {
    gossip_network net{6};
    net.start(some, 1s);
    net.pass(20s);
    constexpr auto dead = some - 16;
    net.pause(dead, 1h);
    net.pass(3550ms);
    BOOST_TEST(net.holding(dead) == 0U);
    BOOST_TEST(net.suspecting(dead) == some - 1);
    net.pass(12s);
    BOOST_TEST(net.suspecting(dead) == 0U); // gone, after 15 intervals
}

BOOST_AUTO_TEST_CASE(in_a_small_network_it_is_noticed_as_soon) {
    gossip_network net{7};
    net.start(4, 100ms);
    net.pass(5s);
    BOOST_TEST(net.whole());
    net.pause(2, 1h);
    net.pass(3500ms);
    BOOST_TEST(net.holding(2) == 0U);
    BOOST_TEST(net.false_suspicions() == 0U);
}

BOOST_AUTO_TEST_CASE(a_node_that_leaves_is_known_by_nobody_after_a_second) {
    running_network net{8};
    net.leave(7);
    net.pass(1s);
    BOOST_TEST(net.holding(7) == 0U);
    BOOST_TEST(net.suspecting(7) == 0U);
    net.pass(30s);
    BOOST_TEST(net.holding(7) == 0U); // and no outdated entry brings it back
}

BOOST_AUTO_TEST_CASE(nodes_that_crash_and_begin_again_are_found_without_a_clash) {
    running_network net{9};
    for (std::size_t i = 0; i < some; i += 3) {
        net.restart(i); // including seeds
        net.pass(100ms);
    }
    net.pass(15s);
    BOOST_TEST(net.whole());
    BOOST_TEST(net.clashes() == 0U);
}

BOOST_AUTO_TEST_CASE(a_network_whose_seeds_have_died_goes_on) {
    running_network net{10, few, 2};
    net.kill(0);
    net.kill(1);
    net.pass(30s);
    BOOST_TEST(net.whole());
    BOOST_TEST(net.living() == few - 2);
}

BOOST_AUTO_TEST_CASE(clocks_that_jump_and_processes_that_were_stopped_for_long_harm_nobody) {
    running_network net{11, few};
    net.forget_verdicts();
    for (std::size_t i = 0; i < few; i += 5) {
        net.jump(i, 10min);
        net.pass(300ms);
    }
    BOOST_TEST(net.false_deaths() == 0U);
    for (std::size_t i = 1; i < few; i += 5) {
        net.pause(i, 10s); // less than 15 intervals
    }
    net.pass(40s);
    BOOST_TEST(net.false_deaths() == 0U);
    BOOST_TEST(net.whole());
}

BOOST_AUTO_TEST_CASE(a_node_that_was_stopped_for_longer_than_it_is_remembered_comes_back) {
    running_network net{12, few};
    constexpr auto stopped = few / 3 * 2;
    net.pause(stopped, 60s);
    net.pass(50s);
    BOOST_TEST(net.holding(stopped) == 0U);
    net.pass(10s);
    net.pause(0, 60s); // a seed
    net.pass(90s);
    BOOST_TEST(net.whole());
    BOOST_TEST(net.clashes() == 0U);
}

BOOST_AUTO_TEST_CASE(what_waits_to_be_read_is_bounded) {
    constexpr std::size_t askers = 36;
    running_network net{13, askers};
    net.pause(3, 30s);
    net.pass(40s);
    // Each node that asks it gives up, and asks another one.
    BOOST_TEST(net.deepest_queue() < askers * 8);
}

// The checks above can detect failures.

BOOST_AUTO_TEST_CASE(a_jump_that_is_not_noticed_is_found) {
    running_network net{11, some, 3, planted::excuse_forgotten};
    net.jump(0, 10min);
    BOOST_TEST(net.false_deaths() > 0U);
}

BOOST_AUTO_TEST_SUITE_END()
