// SPDX-License-Identifier: BSL-1.0
#include "core/presence.hpp"
#include "support/watched_presence.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace presence {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::group_source;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};

struct fixture : cles::test::watched_presence {
    static announcement saying(std::string node, std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = std::move(node), .endpoints = {std::move(endpoint)}};
    }
    verdict hear(const announcement& said, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here) {
        return table.hear(said, epoch, seq, from, clock.now());
    }
    verdict leave(const std::string& node, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here) {
        return hear({.node = node, .leaving = true}, epoch, seq, from);
    }
};

} // namespace
} // namespace presence

BOOST_FIXTURE_TEST_SUITE(presence, fixture)

BOOST_AUTO_TEST_CASE(a_node_that_announces_itself_is_known) {
    BOOST_TEST(where("car1") == "nowhere");
    BOOST_TEST((hear(saying("car1"), 1, 1) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(table.size() == 1U);
    check(told, {"car1 appeared tcp://10.0.0.7:1"});
    pass(700ms);
    const auto all = list();
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(all[0].node == "car1");
    BOOST_TEST(all[0].epoch == "00000001");
    BOOST_TEST((all[0].age == 700ms));
    BOOST_TEST((all[0].state == peer_state::live));
}

BOOST_AUTO_TEST_CASE(one_that_has_no_address_of_use_is_there_but_nowhere) {
    hear(saying("car1", "tcp://127.0.0.1:1"), 1, 1);
    BOOST_TEST(where("car1").empty());
}

BOOST_AUTO_TEST_CASE(this_node_is_not_among_them) {
    BOOST_TEST((hear(saying("me"), 0xAAAA, 1) == verdict::own));
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(old_and_repeated_announcements_are_dropped) {
    hear(saying("car1"), 1, 5);
    pass(600ms);
    BOOST_TEST((hear(saying("car1", "tcp://0.0.0.0:9"), 1, 5) == verdict::old));
    BOOST_TEST((hear(saying("car1", "tcp://0.0.0.0:9"), 1, 4) == verdict::old));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST((list()[0].age == 600ms));
    BOOST_TEST((hear(saying("car1"), 1, 6) == verdict::taken));
    BOOST_TEST((list()[0].age == 0ms));
}

BOOST_AUTO_TEST_CASE(a_node_not_heard_of_for_3_5_of_its_intervals_is_suspect) {
    hear(saying("car1"), 1, 1);
    take_told();
    pass(3499ms);
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(1ms);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    check(take_told(), {"car1 silent tcp://10.0.0.7:1"});
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1"); // still asked by name
    hear(saying("car1"), 1, 2);
    BOOST_TEST((list()[0].state == peer_state::live));
    check(take_told(), {"car1 returned tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(after_15_intervals_it_is_gone) {
    hear(saying("car1"), 1, 1);
    pass(3500ms);
    take_told();
    pass(11'499ms);
    BOOST_TEST(table.size() == 1U);
    pass(1ms);
    BOOST_TEST(table.size() == 0U);
    BOOST_TEST(where("car1") == "nowhere");
    check(take_told(), {"car1 gone tcp://10.0.0.7:1"});
    BOOST_TEST(!deadlines.next()); // nothing left to wait for
}

BOOST_AUTO_TEST_CASE(intervals_are_each_nodes_own) {
    auto slow = saying("slow");
    slow.interval = 10s;
    hear(slow, 1, 1);
    hear(saying("quick"), 2, 1);
    pass(15s);
    BOOST_TEST(where("quick") == "nowhere");
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(20s);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(115s);
    BOOST_TEST(where("slow") == "nowhere");
}

BOOST_AUTO_TEST_CASE(a_leave_removes_at_once) {
    hear(saying("car1"), 1, 1);
    take_told();
    BOOST_TEST((leave("car1", 1, 2) == verdict::taken));
    BOOST_TEST(where("car1") == "nowhere");
    check(told, {"car1 left tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(what_a_node_said_before_it_left_does_not_bring_it_back) {
    hear(saying("car1"), 1, 1);
    leave("car1", 1, 5);
    BOOST_TEST((hear(saying("car1"), 1, 4) == verdict::old));
    BOOST_TEST(where("car1") == "nowhere");
    hear(saying("car1"), 1, 6); // it has not left after all
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
}

BOOST_AUTO_TEST_CASE(the_leave_of_an_unknown_node_is_no_news) {
    BOOST_TEST((leave("car1", 1, 2) == verdict::old));
    BOOST_TEST(told.empty());
}

BOOST_AUTO_TEST_CASE(a_live_name_is_removed_only_by_its_current_epoch_from_its_current_source) {
    hear(saying("car1"), 1, 1);
    leave("car1", 2, 2);        // another epoch
    leave("car1", 1, 2, there); // another source
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    leave("car1", 1, 3);
    BOOST_TEST(where("car1") == "nowhere");
}

BOOST_AUTO_TEST_CASE(a_live_name_is_moved_only_by_its_current_epoch_from_its_current_source) {
    hear(saying("car1"), 1, 1);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 2, here);
    hear(saying("car1", "tcp://0.0.0.0:3"), 1, 2, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    take_told();
    hear(saying("car1", "tcp://0.0.0.0:4"), 1, 3);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:4");
    check(told, {"car1 moved tcp://10.0.0.7:4"});
}

BOOST_AUTO_TEST_CASE(a_restarted_node_is_found_where_it_is_now_when_its_former_run_is_silent) {
    hear(saying("car1"), 1, 1);
    pass(1s); // it is killed, and starts again
    BOOST_TEST((hear(saying("car1", "tcp://0.0.0.0:2"), 2, 1, there) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    pass(1s);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 2, there);
    pass(1s);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 3, there);
    take_told();
    pass(500ms); // 3.5 intervals of the first run
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
    check(told, {"car1 moved tcp://10.0.0.8:2"}); // no clash
    BOOST_REQUIRE(list().size() == 1U);
    BOOST_TEST(list()[0].epoch == "00000002");
}

BOOST_AUTO_TEST_CASE(a_node_that_leaves_and_starts_again_is_found_at_once) {
    hear(saying("car1"), 1, 1);
    leave("car1", 1, 2);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(a_leave_hands_the_name_to_who_waits_for_it) {
    hear(saying("car1"), 1, 1);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    leave("car1", 1, 2); // overtaken by the next run's first words
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(a_suspect_name_is_free_to_the_next_run) {
    hear(saying("car1"), 1, 1);
    pass(4s);
    hear(saying("car1", "tcp://0.0.0.0:2"), 2, 1, there);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
    BOOST_TEST((hear(saying("car1"), 1, 1) == verdict::old)); // a late one of the run before
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:2");
}

BOOST_AUTO_TEST_CASE(a_second_live_node_of_a_name_is_reported_once_and_never_chosen) {
    std::uint64_t seq = 0;
    for (int i = 0; i < 20; ++i) {
        ++seq;
        hear(saying("car1"), 1, seq);
        pass(500ms);
        hear(saying("car1", "tcp://0.0.0.0:2"), 2, seq, there);
        pass(500ms);
        BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    }
    check(told, {"car1 appeared tcp://10.0.0.7:1", "car1 clash 10.0.0.8"});
    const auto all = list();
    BOOST_REQUIRE(all.size() == 2U);
    BOOST_TEST((all[0].state == peer_state::live));
    BOOST_TEST(all[0].epoch == "00000001");
    BOOST_TEST((all[1].state == peer_state::clash));
    BOOST_TEST(all[1].epoch == "00000002");
    BOOST_TEST(all[1].endpoints.front() == "tcp://10.0.0.8:2");
    BOOST_TEST(table.size() == 1U); // of names
}

BOOST_AUTO_TEST_CASE(a_clash_is_over_when_the_second_leaves_or_falls_silent) {
    const auto clash = [&](std::uint64_t seq) {
        hear(saying("car1"), 1, seq);
        hear(saying("car1"), 2, seq, there);
        hear(saying("car1"), 1, seq + 1);
        hear(saying("car1"), 2, seq + 1, there);
        BOOST_TEST(list().size() == 2U);
    };
    clash(1);
    leave("car1", 2, 3, there);
    BOOST_TEST(list().size() == 1U);
    clash(10);
    pass(3s);
    hear(saying("car1"), 1, 20);
    pass(500ms);
    BOOST_REQUIRE(list().size() == 1U);
    BOOST_TEST(list()[0].epoch == "00000001");
}

BOOST_AUTO_TEST_CASE(one_late_word_of_a_former_run_is_no_clash) {
    hear(saying("car1"), 1, 1);
    hear(saying("car1"), 2, 77, there);
    hear(saying("car1"), 1, 2);
    hear(saying("car1"), 2, 77, there); // it comes twice
    hear(saying("car1"), 1, 3);
    check(told, {"car1 appeared tcp://10.0.0.7:1"});
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_third_of_a_name_has_no_room) {
    hear(saying("car1"), 1, 1);
    hear(saying("car1"), 2, 1, there);
    BOOST_TEST((hear(saying("car1"), 3, 1, {0x0A000009, 1}) == verdict::old));
}

BOOST_AUTO_TEST_CASE(another_node_of_this_ones_own_name_is_a_clash) {
    hear(saying("a"), 1, 1);
    hear(saying("z"), 2, 1);
    take_told();
    hear(saying("me"), 3, 1, there);
    BOOST_TEST(told.empty()); // this one's former run may have said that
    hear(saying("me"), 3, 2, there);
    hear(saying("me"), 3, 3, there);
    check(take_told(), {"me clash 10.0.0.8"});
    BOOST_TEST(where("me") == "nowhere");
    const auto all = list();
    BOOST_REQUIRE(all.size() == 3U);
    BOOST_TEST(all[1].node == "me");
    BOOST_TEST((all[1].state == peer_state::clash));
    pass(3500ms);
    BOOST_TEST(list().size() == 2U);
}

BOOST_AUTO_TEST_CASE(past_the_limit_nodes_are_refused) {
    for (int i = 1; i <= 5; ++i) {
        BOOST_TEST((hear(saying("car" + std::to_string(i)), static_cast<std::uint32_t>(i), 1) == verdict::taken));
    }
    BOOST_TEST((hear(saying("car6"), 6, 1) == verdict::refused));
    BOOST_TEST(where("car6") == "nowhere");
    leave("car3", 3, 2);
    BOOST_TEST((hear(saying("car6"), 6, 2) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(the_best_of_several_endpoints_is_chosen_and_kept_first) {
    hear({.node = "car1", .endpoints = {"udp://0.0.0.0:1", "tcp://0.0.0.0:2"}}, 1, 1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:2");
    BOOST_TEST(list()[0].endpoints.front() == "tcp://10.0.0.7:2");
    take_told();
    hear({.node = "car1", .endpoints = {"udp://0.0.0.0:1"}}, 1, 2);
    check(told, {"car1 moved udp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_SUITE_END()
