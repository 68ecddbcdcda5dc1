// SPDX-License-Identifier: BSL-1.0
// What a node makes of what others tell it (docs/protocol.md, "Gossip").
#include "core/presence.hpp"
#include "support/watched_presence.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace presence_told {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::news_item;
using cles::core::peer_report;
using cles::core::teller;

constexpr group_source in_group{0x0A000009, 40000};
const auto by_other_host = teller::at("tcp://10.0.0.7:25370");
const auto by_this_host = teller::at("tcp://127.0.0.1:25370");

struct fixture : cles::test::watched_presence {
    static peer_report report(std::string node, std::uint32_t epoch, std::uint64_t seq, std::chrono::milliseconds age,
                              std::string endpoint = "tcp://10.0.0.9:1") {
        return {.said = {.node = std::move(node), .endpoints = {std::move(endpoint)}, .tasks = "00"},
                .epoch = epoch,
                .seq = seq,
                .age = age,
                .has_interval = true};
    }
    verdict tell(const peer_report& r, const teller& by = by_other_host) {
        return table.be_told(r, by, clock.now(), clock.now());
    }
    verdict beat(std::uint32_t epoch, std::uint64_t seq, std::chrono::milliseconds age) {
        return table.be_told({.epoch = epoch, .seq = seq, .age = age, .interval = 1s, .queued = 3, .running = 4},
                             clock.now(), clock.now());
    }
    verdict farewell(const std::string& node, std::uint32_t epoch, std::uint64_t seq,
                     std::chrono::milliseconds age = 0ms) {
        auto r = report(node, epoch, seq, age);
        r.said.leaving = true;
        return tell(r);
    }
    [[nodiscard]] std::vector<news_item> news(std::uint64_t since = 0) const {
        return table.news_since(since, clock.now());
    }
};

} // namespace
} // namespace presence_told

BOOST_FIXTURE_TEST_SUITE(presence_told, fixture)

BOOST_AUTO_TEST_CASE(a_node_that_others_tell_of_is_known_with_its_age) {
    BOOST_TEST((tell(report("car1", 1, 7, 600ms)) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    BOOST_TEST((list()[0].age == 600ms));
    check(told, {"car1 appeared tcp://10.0.0.9:1"});
}

BOOST_AUTO_TEST_CASE(ages_count_from_when_was_asked) {
    const auto asked = clock.now();
    clock.advance(50ms);
    table.be_told(report("car1", 1, 7, 600ms), by_other_host, asked, clock.now());
    BOOST_TEST((list()[0].age == 650ms));
}

BOOST_AUTO_TEST_CASE(silence_is_noticed_at_the_same_time_however_long_the_way) {
    tell(report("car1", 1, 7, 3s));
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(500ms);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(11'500ms);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(a_greater_seq_is_news_and_an_equal_one_is_none_however_young) {
    tell(report("car1", 1, 7, 600ms));
    BOOST_TEST((tell(report("car1", 1, 7, 0ms)) == verdict::old));
    BOOST_TEST((list()[0].age == 600ms));
    BOOST_TEST((tell(report("car1", 1, 6, 0ms)) == verdict::old));
    BOOST_TEST((tell(report("car1", 1, 8, 100ms)) == verdict::taken));
    BOOST_TEST((list()[0].age == 100ms));
}

BOOST_AUTO_TEST_CASE(without_a_seq_what_is_younger_by_half_an_interval_is_news) {
    tell(report("car1", 1, 0, 600ms));
    BOOST_TEST((tell(report("car1", 1, 0, 101ms)) == verdict::old));
    BOOST_TEST((tell(report("car1", 1, 0, 100ms)) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(a_beat_says_that_a_known_run_lives) {
    BOOST_TEST((beat(1, 7, 0ms) == verdict::unknown));
    tell(report("car1", 1, 7, 600ms));
    const auto before = table.latest_news();
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST(table.latest_news() == before); // what is no news is not passed on
    BOOST_TEST((beat(1, 8, 100ms) == verdict::taken));
    BOOST_TEST(list()[0].load.queued == 3U);
    BOOST_TEST(list()[0].load.running == 4U);
    BOOST_TEST((list()[0].age == 100ms));
    BOOST_REQUIRE(news(before).size() == 1U);
    BOOST_TEST((news(before)[0].what == news_item::kind::beat));
    BOOST_TEST((beat(0xAAAA, 9, 0ms) == verdict::own));
}

BOOST_AUTO_TEST_CASE(a_suspect_of_which_is_told_again_is_back) {
    tell(report("car1", 1, 7, 0ms));
    pass(4s);
    take_told();
    beat(1, 8, 200ms);
    check(take_told(), {"car1 returned tcp://10.0.0.9:1"});
    BOOST_TEST((list()[0].state == peer_state::live));
}

BOOST_AUTO_TEST_CASE(the_last_word_of_a_suspect_that_comes_late_does_not_bring_it_back) {
    tell(report("car1", 1, 7, 0ms));
    pass(4500ms);
    take_told();
    BOOST_TEST((beat(1, 8, 3500ms) == verdict::taken));
    BOOST_TEST(told.empty());
    BOOST_TEST((list()[0].state == peer_state::suspect));
}

BOOST_AUTO_TEST_CASE(a_name_is_not_made_known_by_old_news) {
    BOOST_TEST((tell(report("car1", 1, 7, 3500ms)) == verdict::old));
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(an_unspecified_address_is_the_tellers_and_passed_on_as_his) {
    tell(report("car1", 1, 7, 0ms, "tcp://0.0.0.0:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(news()[0].endpoints->front() == "tcp://10.0.0.7:1");
    tell(report("car2", 2, 7, 0ms, "tcp://0.0.0.0:1"), by_this_host);
    BOOST_TEST(where("car2") == "tcp://127.0.0.1:1");
    BOOST_TEST(news()[1].endpoints->front() == "tcp://0.0.0.0:1"); // whoever asks this host is told of this host
}

BOOST_AUTO_TEST_CASE(where_a_run_is_does_not_change_by_what_is_told_but_for_more) {
    tell(report("car1", 1, 7, 0ms));
    tell(report("car1", 1, 8, 0ms, "tcp://10.0.0.10:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    auto more = report("car1", 1, 9, 0ms);
    more.said.endpoints = {"tcp://10.0.0.11:1", "tcp://10.0.0.9:1"};
    tell(more);
    BOOST_TEST(where("car1") == "tcp://10.0.0.11:1");
}

BOOST_AUTO_TEST_CASE(one_that_could_not_be_reached_is_where_another_one_says) {
    tell(report("car1", 1, 7, 0ms, "tcp://127.0.0.1:1"));
    BOOST_TEST(where("car1").empty());
    take_told();
    tell(report("car1", 1, 7, 0ms, "tcp://10.0.0.9:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    check(take_told(), {"car1 moved tcp://10.0.0.9:1"});
}

BOOST_AUTO_TEST_CASE(announcements_by_multicast_and_what_is_told_feed_one_table) {
    table.hear({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}, .tasks = "00"}, 1, 7, in_group, clock.now());
    BOOST_TEST((beat(1, 8, 100ms) == verdict::taken));
    BOOST_TEST((tell(report("car1", 1, 9, 0ms, "tcp://10.0.0.10:1")) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1"); // it said so itself
    BOOST_TEST((table.hear({.node = "car1", .endpoints = {"tcp://0.0.0.0:2"}}, 1, 10, in_group, clock.now()) ==
                verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:2");
    BOOST_TEST(table.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_run_of_which_was_told_is_the_one_heard_of_the_same_epoch) {
    tell(report("car1", 1, 7, 0ms, "tcp://10.0.0.10:1"));
    table.hear({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}}, 1, 8, in_group, clock.now());
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_farewell_ends_a_run_and_is_passed_on) {
    tell(report("car1", 1, 7, 0ms));
    take_told();
    const auto before = table.latest_news();
    BOOST_TEST((farewell("car1", 1, 8) == verdict::taken));
    check(take_told(), {"car1 left tcp://10.0.0.9:1"});
    BOOST_REQUIRE(news(before).size() == 1U);
    BOOST_TEST((news(before)[0].what == news_item::kind::farewell));
    BOOST_TEST((farewell("car1", 1, 8) == verdict::old));
    BOOST_TEST((tell(report("car1", 1, 7, 100ms)) == verdict::old)); // older news does not bring it back
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST((tell(report("car1", 1, 9, 0ms)) == verdict::taken));
}

// Whoever asks may have been told in full while it could not believe it yet: from then on it hears beats alone.
BOOST_AUTO_TEST_CASE(a_later_beat_of_a_run_that_has_gone_asks_for_more) {
    tell(report("car1", 1, 7, 0ms));
    pass(15s);
    check(take_told(), {"car1 appeared tcp://10.0.0.9:1", "car1 gone tcp://10.0.0.9:1"});
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST((beat(1, 8, 0ms) == verdict::unknown));
    BOOST_TEST((tell(report("car1", 1, 8, 0ms)) == verdict::taken));
    BOOST_TEST((beat(1, 9, 0ms) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(the_farewell_of_an_unknown_run_is_remembered_for_15_intervals) {
    farewell("car1", 1, 8);
    BOOST_TEST((tell(report("car1", 1, 7, 100ms)) == verdict::old));
    BOOST_TEST(news().size() == 1U);
    pass(15s);
    BOOST_TEST(news().empty());
    BOOST_TEST((farewell("car2", 2, 8, 15s) == verdict::old));
}

BOOST_AUTO_TEST_CASE(a_run_heard_in_the_group_is_ended_by_no_farewell_but_its_own_there) {
    table.hear({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}}, 1, 7, in_group, clock.now());
    BOOST_TEST((farewell("car1", 1, 8) == verdict::old));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    table.hear({.node = "car1", .leaving = true}, 1, 8, in_group, clock.now());
    BOOST_TEST(where("car1") == "nowhere");
}

BOOST_AUTO_TEST_CASE(a_restart_is_told_by_its_epoch_and_is_no_clash) {
    tell(report("car1", 1, 50, 0ms));
    pass(1s); // it was killed, and runs again
    BOOST_TEST((tell(report("car1", 2, 1, 0ms, "tcp://10.0.0.9:2")) == verdict::taken));
    BOOST_TEST((tell(report("car1", 1, 51, 800ms)) == verdict::taken)); // news of its last word comes late
    for (std::uint64_t seq = 2; seq <= 5; ++seq) {
        pass(700ms);
        beat(2, seq, 50ms);
    }
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:2");
    check(take_told(), {"car1 appeared tcp://10.0.0.9:1", "car1 moved tcp://10.0.0.9:2"});
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(two_live_nodes_of_a_name_are_a_clash_and_both_are_told_of) {
    for (std::uint64_t seq = 1; seq <= 6; ++seq) {
        tell(report("car1", 1, seq, 100ms));
        tell(report("car1", 2, seq, 100ms, "tcp://10.0.0.10:1"));
        pass(700ms);
        BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    }
    check(take_told(), {"car1 appeared tcp://10.0.0.9:1", "car1 clash tcp://10.0.0.10:1"});
    BOOST_REQUIRE(list().size() == 2U);
    BOOST_TEST((list()[1].state == peer_state::clash));
    BOOST_TEST(news().size() == 2U);
    BOOST_TEST((beat(2, 7, 0ms) == verdict::taken)); // and so is a beat of the second
}

BOOST_AUTO_TEST_CASE(a_former_run_of_this_node_is_no_clash_but_another_node_is) {
    pass(10s);
    table.speak({.node = "me"}, 1, clock.now());
    tell(report("me", 3, 50, 2s));
    tell(report("me", 3, 51, 1s)); // late news of the run before
    BOOST_TEST(told.empty());
    BOOST_TEST(table.size() == 0U);
    pass(5s);
    tell(report("me", 4, 60, 1s)); // spoken while this node was there
    tell(report("me", 4, 61, 0ms));
    tell(report("me", 4, 62, 0ms));
    check(take_told(), {"me clash tcp://10.0.0.9:1"});
    BOOST_TEST((beat(4, 63, 0ms) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(nobody_is_suspect_or_gone_because_this_node_was_stopped) {
    tell(report("car1", 1, 7, 0ms));
    clock.advance(100s);
    table.excuse(clock.now());
    deadlines.expire(clock.now());
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(3499ms);
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(1ms); // it should have been heard by now
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(11'500ms);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(this_node_is_told_of_as_it_announced_itself) {
    BOOST_TEST(table.own() == nullptr);
    table.speak({.node = "me", .endpoints = {"tcp://0.0.0.0:1"}}, 1, clock.now());
    BOOST_REQUIRE(news().size() == 1U);
    const auto before = table.latest_news();
    table.speak({.node = "me", .endpoints = {"tcp://0.0.0.0:1"}}, 2, clock.now());
    BOOST_REQUIRE(news(before).size() == 1U);
    BOOST_TEST((news(before)[0].what == news_item::kind::beat));
    BOOST_TEST(news(before)[0].seq == 2U);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(names_follow_each_other_in_a_ring) {
    BOOST_TEST(!table.after("me").has_value());
    tell(report("car1", 1, 1, 0ms));
    tell(report("zug", 2, 1, 0ms));
    BOOST_TEST(table.after("me")->node == "zug");
    BOOST_TEST(table.after("zug")->node == "car1");
    BOOST_TEST(table.at(1).node == "zug");
    BOOST_TEST(table.look("car1")->epoch == 1U);
    BOOST_TEST(!table.look("car9").has_value());
}

BOOST_AUTO_TEST_CASE(past_the_limit_what_is_told_is_refused) {
    for (std::uint32_t i = 1; i <= 5; ++i) {
        tell(report("car" + std::to_string(i), i, 1, 0ms));
    }
    BOOST_TEST((tell(report("car6", 6, 1, 0ms)) == verdict::refused));
}

BOOST_AUTO_TEST_SUITE_END()
