// SPDX-License-Identifier: BSL-1.0
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace membership {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::group_source;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};

struct fixture : cles::test::watched_membership {
    static announcement make_announcement(std::string node, std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = std::move(node), .endpoints = {std::move(endpoint)}};
    }
    verdict receive(const announcement& said, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here) {
        return table.apply_announcement(said, epoch, seq, from, clock.now());
    }
    verdict leave(const std::string& node, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here) {
        return receive({.node = node, .leaving = true}, epoch, seq, from);
    }
};

} // namespace
} // namespace membership

BOOST_FIXTURE_TEST_SUITE(membership, fixture)

BOOST_AUTO_TEST_CASE(node_that_announces_itself_is_known) {
    BOOST_TEST(where("car1") == "nowhere");
    BOOST_TEST((receive(make_announcement("car1"), 1, 1) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(table.size() == 1U);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
    pass(700ms);
    const auto all = list();
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(all[0].node == "car1");
    BOOST_TEST(all[0].epoch == "00000001");
    BOOST_TEST((all[0].age == 700ms));
    BOOST_TEST((all[0].state == peer_state::live));
}

BOOST_AUTO_TEST_CASE(node_without_a_usable_address_is_known_but_not_reachable) {
    receive(make_announcement("car1", "tcp://127.0.0.1:1"), 1, 1);
    BOOST_TEST(where("car1").empty());
}

BOOST_AUTO_TEST_CASE(this_node_is_not_listed) {
    BOOST_TEST((receive(make_announcement("me"), 0xAAAA, 1) == verdict::own));
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(old_and_repeated_announcements_are_dropped) {
    receive(make_announcement("car1"), 1, 5);
    pass(600ms);
    BOOST_TEST((receive(make_announcement("car1", "tcp://0.0.0.0:9"), 1, 5) == verdict::old));
    BOOST_TEST((receive(make_announcement("car1", "tcp://0.0.0.0:9"), 1, 4) == verdict::old));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST((list()[0].age == 600ms));
    BOOST_TEST((receive(make_announcement("car1"), 1, 6) == verdict::taken));
    BOOST_TEST((list()[0].age == 0ms));
}

BOOST_AUTO_TEST_CASE(node_is_suspect_after_3_5_silent_intervals) {
    receive(make_announcement("car1"), 1, 1);
    take_changes();
    pass(3499ms);
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(1ms);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    check(take_changes(), {"car1 silent tcp://10.0.0.7:1"});
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1"); // requests by name still go there
    receive(make_announcement("car1"), 1, 2);
    BOOST_TEST((list()[0].state == peer_state::live));
    check(take_changes(), {"car1 returned tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(node_is_removed_after_15_silent_intervals) {
    receive(make_announcement("car1"), 1, 1);
    pass(3500ms);
    take_changes();
    pass(11'499ms);
    BOOST_TEST(table.size() == 1U);
    pass(1ms);
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST(where("car1") == "nowhere");
    check(take_changes(), {"car1 gone tcp://10.0.0.7:1"});
    BOOST_TEST(!deadlines.next()); // nothing left to wait for
}

BOOST_AUTO_TEST_CASE(each_node_has_its_own_interval) {
    auto slow = make_announcement("slow");
    slow.interval = 10s;
    receive(slow, 1, 1);
    receive(make_announcement("quick"), 2, 1);
    pass(15s);
    BOOST_TEST(where("quick") == "nowhere");
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(20s);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(115s);
    BOOST_TEST(where("slow") == "nowhere");
}

BOOST_AUTO_TEST_CASE(leave_removes_at_once) {
    receive(make_announcement("car1"), 1, 1);
    take_changes();
    BOOST_TEST((leave("car1", 1, 2) == verdict::taken));
    BOOST_TEST(where("car1") == "nowhere");
    check(changes, {"car1 left tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(announcements_made_before_a_leave_are_ignored) {
    receive(make_announcement("car1"), 1, 1);
    leave("car1", 1, 5);
    BOOST_TEST((receive(make_announcement("car1"), 1, 4) == verdict::old));
    BOOST_TEST(where("car1") == "nowhere");
    receive(make_announcement("car1"), 1, 6); // it is alive after all
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(leave_of_an_unknown_node_is_ignored) {
    BOOST_TEST((leave("car1", 1, 2) == verdict::old));
    BOOST_TEST(changes.empty());
}

BOOST_AUTO_TEST_CASE(live_name_is_removed_only_by_its_current_epoch_and_source) {
    receive(make_announcement("car1"), 1, 1);
    leave("car1", 2, 2);        // another epoch
    leave("car1", 1, 2, there); // another source
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    leave("car1", 1, 3);
    BOOST_TEST(where("car1") == "nowhere");
}

BOOST_AUTO_TEST_CASE(live_name_is_moved_only_by_its_current_epoch_and_source) {
    receive(make_announcement("car1"), 1, 1);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 2, here);
    receive(make_announcement("car1", "tcp://0.0.0.0:3"), 1, 2, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    take_changes();
    receive(make_announcement("car1", "tcp://0.0.0.0:4"), 1, 3);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:4");
    check(changes, {"car1 moved tcp://10.0.0.7:4"});
}

BOOST_AUTO_TEST_CASE(restarted_node_is_found_when_its_previous_incarnation_is_silent) {
    receive(make_announcement("car1"), 1, 1);
    pass(1s); // it is killed, and restarts
    BOOST_TEST((receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 1, there) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    pass(1s);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 2, there);
    pass(1s);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 3, there);
    take_changes();
    pass(500ms); // 3.5 intervals of the first incarnation
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
    check(changes, {"car1 moved tcp://10.0.0.8:2"}); // no name conflict
    BOOST_REQUIRE(list().size() == 1U);
    BOOST_TEST(list()[0].epoch == "00000002");
}

BOOST_AUTO_TEST_CASE(node_that_leaves_and_restarts_is_found_at_once) {
    receive(make_announcement("car1"), 1, 1);
    leave("car1", 1, 2);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(leave_passes_the_name_to_the_contender) {
    receive(make_announcement("car1"), 1, 1);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    leave("car1", 1, 2); // overtaken by the next incarnation's first announcement
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(suspect_name_is_free_for_the_next_incarnation) {
    receive(make_announcement("car1"), 1, 1);
    pass(4s);
    receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
    BOOST_TEST((receive(make_announcement("car1"), 1, 1) == verdict::old)); // late, of the previous incarnation
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(second_live_node_of_a_name_is_reported_once_and_never_chosen) {
    std::uint64_t seq = 0;
    for (int i = 0; i < 20; ++i) {
        ++seq;
        receive(make_announcement("car1"), 1, seq);
        pass(500ms);
        receive(make_announcement("car1", "tcp://0.0.0.0:2"), 2, seq, there);
        pass(500ms);
        BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    }
    check(changes, {"car1 appeared tcp://10.0.0.7:1", "car1 clash 10.0.0.8"});
    const auto all = list();
    BOOST_REQUIRE(all.size() == 2U);
    BOOST_TEST((all[0].state == peer_state::live));
    BOOST_TEST(all[0].epoch == "00000001");
    BOOST_TEST((all[1].state == peer_state::clash));
    BOOST_TEST(all[1].epoch == "00000002");
    BOOST_TEST(all[1].endpoints.front() == "tcp://10.0.0.8:2");
    BOOST_TEST(table.size() == 1U); // of names
}

BOOST_AUTO_TEST_CASE(conflict_ends_when_the_contender_leaves_or_becomes_silent) {
    const auto clash = [&](std::uint64_t seq) {
        receive(make_announcement("car1"), 1, seq);
        receive(make_announcement("car1"), 2, seq, there);
        receive(make_announcement("car1"), 1, seq + 1);
        receive(make_announcement("car1"), 2, seq + 1, there);
        BOOST_TEST(list().size() == 2U);
    };
    clash(1);
    leave("car1", 2, 3, there);
    BOOST_TEST(list().size() == 1U);
    clash(10);
    pass(3s);
    receive(make_announcement("car1"), 1, 20);
    pass(500ms);
    BOOST_REQUIRE(list().size() == 1U);
    BOOST_TEST(list()[0].epoch == "00000001");
}

BOOST_AUTO_TEST_CASE(late_announcement_of_the_previous_incarnation_is_not_a_conflict) {
    receive(make_announcement("car1"), 1, 1);
    receive(make_announcement("car1"), 2, 77, there);
    receive(make_announcement("car1"), 1, 2);
    receive(make_announcement("car1"), 2, 77, there); // received twice
    receive(make_announcement("car1"), 1, 3);
    check(changes, {"car1 appeared tcp://10.0.0.7:1"});
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(third_incarnation_of_a_name_is_ignored) {
    receive(make_announcement("car1"), 1, 1);
    receive(make_announcement("car1"), 2, 1, there);
    BOOST_TEST((receive(make_announcement("car1"), 3, 1, {0x0A000009, 1}) == verdict::old));
}

BOOST_AUTO_TEST_CASE(another_node_with_the_own_name_is_a_conflict) {
    receive(make_announcement("a"), 1, 1);
    receive(make_announcement("z"), 2, 1);
    take_changes();
    receive(make_announcement("me"), 3, 1, there);
    BOOST_TEST(changes.empty()); // it may be this node's previous incarnation
    receive(make_announcement("me"), 3, 2, there);
    receive(make_announcement("me"), 3, 3, there);
    check(take_changes(), {"me clash 10.0.0.8"});
    BOOST_TEST(where("me") == "nowhere");
    const auto all = list();
    BOOST_REQUIRE(all.size() == 3U);
    BOOST_TEST(all[1].node == "me");
    BOOST_TEST((all[1].state == peer_state::clash));
    pass(3500ms);
    BOOST_TEST(list().size() == 2U);
}

BOOST_AUTO_TEST_CASE(nodes_beyond_the_limit_are_refused) {
    for (int i = 1; i <= 5; ++i) {
        BOOST_TEST((receive(make_announcement("car" + std::to_string(i)), static_cast<std::uint32_t>(i), 1) ==
                    verdict::taken));
    }
    BOOST_TEST((receive(make_announcement("car6"), 6, 1) == verdict::refused));
    BOOST_TEST(where("car6") == "nowhere");
    leave("car3", 3, 2);
    BOOST_TEST((receive(make_announcement("car6"), 6, 2) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(best_of_several_endpoints_is_used_and_listed_first) {
    receive({.node = "car1", .endpoints = {"udp://0.0.0.0:1", "tcp://0.0.0.0:2"}}, 1, 1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:2");
    BOOST_TEST(list()[0].endpoints.front() == "tcp://10.0.0.7:2");
    take_changes();
    receive({.node = "car1", .endpoints = {"udp://0.0.0.0:1"}}, 1, 2);
    check(changes, {"car1 moved udp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_SUITE_END()
