// SPDX-License-Identifier: BSL-1.0
// Which of two runs of one name is there (docs/protocol.md, "Name ownership").
#include "core/presence.hpp"
#include "support/watched_presence.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace presence_checks {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::probe_outcome;
using cles::core::teller;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};

struct fixture : cles::test::watched_presence, cles::core::presence::prober {
    fixture() {
        table.probe_by(this);
        table.begin({}, clock.now());
    }

    void probe(std::uint64_t ticket, std::string_view url) override {
        last = ticket;
        asked.emplace_back(url);
    }
    verdict hear(const std::string& node, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here,
                 const std::string& pool = {}) {
        return table.hear({.node = node, .endpoints = {"tcp://0.0.0.0:1"}, .pool = pool}, epoch, seq, from,
                          clock.now());
    }
    void is_absent() { table.on_probed(last, {.what = probe_outcome::kind::absent}, clock.now()); }
    void answers(std::uint32_t epoch, std::chrono::milliseconds uptime, const std::string& node = "car1") {
        table.on_probed(last, {probe_outcome::kind::answered, node, epoch, uptime}, clock.now());
    }

    std::uint64_t last = 0;
    std::vector<std::string> asked;
};

using lines = std::vector<std::string>;

} // namespace
} // namespace presence_checks

BOOST_FIXTURE_TEST_SUITE(presence_checks, fixture)

BOOST_AUTO_TEST_CASE(the_owner_of_a_name_is_asked_once_when_another_run_announces_it) {
    hear("car1", 1, 1);
    BOOST_TEST(asked.empty());
    hear("car1", 2, 1, there);
    check(asked, {"tcp://10.0.0.7:1"});
    hear("car1", 2, 2, there);
    BOOST_TEST(asked.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_name_moves_at_once_when_its_owner_is_not_there) {
    hear("car1", 1, 1);
    pass(1s);
    hear("car1", 2, 1, there);
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST((*table.source_of("car1") == there));
    check(take_told(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved tcp://10.0.0.8:1"});
    BOOST_TEST((hear("car1", 1, 1) == verdict::old)); // late words of the one before
}

BOOST_AUTO_TEST_CASE(who_answers_as_another_run_is_not_the_owner) {
    hear("car1", 1, 1);
    hear("car1", 2, 1, there);
    answers(2, 1s); // it was started again at the same place
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(who_does_not_say_who_he_is_settles_nothing) {
    hear("car1", 1, 1);
    hear("car1", 2, 1, there);
    table.on_probed(last, {}, clock.now());
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(asked.size() == 1U);
    pass(3s);
    hear("car1", 2, 2, there);
    pass(500ms); // as without asking
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(where_both_answer_it_is_a_clash_and_the_first_stays) {
    hear("car1", 1, 1);
    pass(1500ms);
    hear("car1", 2, 1, there);
    answers(1, 1500ms);
    check(asked, {"tcp://10.0.0.7:1", "tcp://10.0.0.8:1"});
    BOOST_TEST(!table.second_of("car1").has_value());
    answers(2, 100ms);
    BOOST_TEST(*table.second_of("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    check(take_told(), {"car1 appeared tcp://10.0.0.7:1", "car1 clash 10.0.0.8"});
    BOOST_TEST((list()[1].state == peer_state::clash));
    table.hear({.node = "car1", .leaving = true}, 2, 5, there, clock.now());
    BOOST_TEST(!table.second_of("car1").has_value());
}

BOOST_AUTO_TEST_CASE(a_second_that_does_not_answer_is_no_clash_by_that) {
    hear("car1", 1, 1);
    hear("car1", 2, 1, there);
    answers(1, 1500ms);
    is_absent();
    BOOST_TEST(!table.second_of("car1").has_value());
    check(take_told(), {"car1 appeared tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(of_two_that_started_together_the_lower_epoch_stays) {
    hear("car1", 2, 1); // whoever comes now hears them in any order
    pass(200ms);
    hear("car1", 1, 1, there);
    answers(2, 900ms);
    answers(1, 400ms);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST(table.look("car1")->epoch == 1U);
    BOOST_TEST(*table.second_of("car1") == "tcp://10.0.0.7:1");
    check(take_told(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved tcp://10.0.0.8:1", "car1 clash 10.0.0.7"});
    hear("car1", 1, 2, there);
    hear("car1", 2, 2);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(one_that_was_there_long_before_is_the_owner_whoever_is_heard_first) {
    hear("car1", 1, 1);
    hear("car1", 2, 900, there);
    answers(1, 2s);
    answers(2, 900s);
    BOOST_TEST(table.look("car1")->epoch == 2U);
}

BOOST_AUTO_TEST_CASE(one_that_began_when_the_other_was_known_is_the_second_whatever_its_epoch) {
    hear("car1", 2, 1);
    pass(500ms);
    hear("car1", 1, 1, there);
    answers(2, 600ms);
    answers(1, 100ms);
    BOOST_TEST(table.look("car1")->epoch == 2U);
}

BOOST_AUTO_TEST_CASE(silence_says_nothing_where_this_node_was_stopped) {
    hear("car1", 1, 1);
    hear("car1", 2, 1, there);
    clock.advance(100s);
    table.excuse(clock.now());
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    hear("car1", 2, 2, there);
    BOOST_TEST(asked.size() == 2U); // once more
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(this_nodes_name_is_taken_where_another_had_it_first) {
    table.begin({}, clock.now());
    pass(200ms);
    hear("me", 3, 40, there);
    check(asked, {"tcp://10.0.0.8:1"});
    answers(3, 60s, "me");
    check(take_told(), {"me clash 10.0.0.8", "me taken tcp://10.0.0.8:1"});
}

BOOST_AUTO_TEST_CASE(this_nodes_name_stays_its_own_where_it_had_it_first_or_its_epoch_is_lower) {
    pass(60s);
    hear("me", 3, 1, there);
    answers(3, 100ms, "me");
    check(take_told(), {"me clash 10.0.0.8"});

    fixture together;
    together.pass(100ms);
    together.hear("me", 0xBBBB, 1, there); // its own is aaaa
    together.answers(0xBBBB, 600ms, "me");
    check(together.take_told(), {"me clash 10.0.0.8"});

    fixture lower;
    lower.pass(600ms);
    lower.hear("me", 0x0001, 1, there);
    lower.answers(0x0001, 100ms, "me");
    check(lower.take_told(), {"me clash 10.0.0.8", "me taken tcp://10.0.0.8:1"});
}

BOOST_AUTO_TEST_CASE(a_former_run_of_this_node_takes_nothing) {
    hear("me", 3, 40, there);
    is_absent();
    hear("me", 4, 40, there);
    BOOST_TEST(told.empty());
    fixture same_place;
    same_place.hear("me", 3, 40, there);
    same_place.answers(0xAAAA, 10ms, "me"); // it is this node itself
    BOOST_TEST(same_place.told.empty());
}

BOOST_AUTO_TEST_CASE(whoever_announces_names_without_end_does_not_have_nodes_asked_without_end) {
    for (std::uint32_t i = 1; i <= 5; ++i) {
        hear("car" + std::to_string(i), i, 1);
    }
    for (std::uint32_t round = 1; round <= 1000; ++round) {
        for (std::uint32_t i = 1; i <= 5; ++i) {
            hear("car" + std::to_string(i), i, round + 1);
            table.hear({.node = "car" + std::to_string(i), .endpoints = {"tcp://0.0.0.0:2"}, .interval = 250ms},
                       1000 + round * 10 + i, 1, there, clock.now());
        }
        pass(100ms);
        answers(0, 1s);
    }
    BOOST_TEST(asked.size() <= 2100U); // 20 a second for 100 s, and what had been saved
}

BOOST_AUTO_TEST_CASE(nodes_of_other_pools_are_not_known) {
    BOOST_TEST((hear("car1", 1, 1, here, "north") == verdict::foreign));
    BOOST_TEST(table.size() == 0U);
    table.begin("north", clock.now());
    BOOST_TEST((hear("car1", 1, 2, here, "north") == verdict::taken));
    BOOST_TEST((hear("car2", 2, 1) == verdict::foreign));
    BOOST_TEST((hear("car2", 2, 1, here, "south") == verdict::foreign));
    BOOST_TEST((table.be_told({.said = {.node = "car3", .endpoints = {"tcp://10.0.0.9:1"}}, .epoch = 3, .seq = 1},
                              teller::of(here), clock.now(), clock.now()) == verdict::foreign));
    BOOST_TEST(table.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
