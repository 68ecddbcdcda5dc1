// SPDX-License-Identifier: BSL-1.0
// Probing which of two incarnations of one name is alive (docs/protocol.md, "Name ownership").
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace membership_probes {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::observed_source;
using cles::core::probe_outcome;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};

struct fixture : cles::test::watched_membership {
    fixture() {
        table.set_prober([this](std::uint64_t ticket, std::string_view url) {
            last = ticket;
            asked.emplace_back(url);
        });
        table.begin({}, clock.now());
    }

    verdict receive(const std::string& node, std::uint32_t epoch, std::uint64_t seq, const group_source& from = here,
                    const std::string& pool = {}) {
        return table.apply_announcement({.node = node, .endpoints = {"tcp://0.0.0.0:1"}, .pool = pool}, epoch, seq,
                                        from, clock.now());
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
} // namespace membership_probes

BOOST_FIXTURE_TEST_SUITE(membership_probes, fixture)

BOOST_AUTO_TEST_CASE(owner_is_probed_once_when_another_incarnation_announces_its_name) {
    receive("car1", 1, 1);
    BOOST_TEST(asked.empty());
    receive("car1", 2, 1, there);
    check(asked, {"tcp://10.0.0.7:1"});
    receive("car1", 2, 2, there);
    BOOST_TEST(asked.size() == 1U);
}

BOOST_AUTO_TEST_CASE(name_moves_at_once_if_its_owner_is_absent) {
    receive("car1", 1, 1);
    pass(1s);
    receive("car1", 2, 1, there);
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST((table.announced("car1")->from == there));
    check(take_changes(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved tcp://10.0.0.8:1"});
    BOOST_TEST((receive("car1", 1, 1) == verdict::old)); // late, of the former owner
}

BOOST_AUTO_TEST_CASE(reply_of_another_incarnation_is_not_the_owners) {
    receive("car1", 1, 1);
    receive("car1", 2, 1, there);
    answers(2, 1s); // it was restarted at the same address
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(unclear_reply_decides_nothing) {
    receive("car1", 1, 1);
    receive("car1", 2, 1, there);
    table.on_probed(last, {}, clock.now());
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(asked.size() == 1U);
    pass(3s);
    receive("car1", 2, 2, there);
    pass(500ms); // as without a probe
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(if_both_answer_it_is_a_conflict_and_the_first_stays) {
    receive("car1", 1, 1);
    pass(1500ms);
    receive("car1", 2, 1, there);
    answers(1, 1500ms);
    check(asked, {"tcp://10.0.0.7:1", "tcp://10.0.0.8:1"});
    BOOST_TEST(table.second_of("car1").empty());
    answers(2, 100ms);
    BOOST_TEST(table.second_of("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    check(take_changes(), {"car1 appeared tcp://10.0.0.7:1", "car1 clash 10.0.0.8"});
    BOOST_TEST((list()[1].state == peer_state::clash));
    table.apply_announcement({.node = "car1", .leaving = true}, 2, 5, there, clock.now());
    BOOST_TEST(table.second_of("car1").empty());
}

BOOST_AUTO_TEST_CASE(contender_that_does_not_answer_is_not_a_conflict) {
    receive("car1", 1, 1);
    receive("car1", 2, 1, there);
    answers(1, 1500ms);
    is_absent();
    BOOST_TEST(table.second_of("car1").empty());
    check(take_changes(), {"car1 appeared tcp://10.0.0.7:1"});
}

BOOST_AUTO_TEST_CASE(of_two_that_started_together_the_lower_epoch_stays) {
    receive("car1", 2, 1); // a node that starts now receives them in any order
    pass(200ms);
    receive("car1", 1, 1, there);
    answers(2, 900ms);
    answers(1, 400ms);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
    BOOST_TEST(table.find_member("car1")->epoch == 1U);
    BOOST_TEST(table.second_of("car1") == "tcp://10.0.0.7:1");
    check(take_changes(), {"car1 appeared tcp://10.0.0.7:1", "car1 moved tcp://10.0.0.8:1", "car1 clash 10.0.0.7"});
    receive("car1", 1, 2, there);
    receive("car1", 2, 2);
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(much_older_incarnation_is_the_owner_even_if_received_second) {
    receive("car1", 1, 1);
    receive("car1", 2, 900, there);
    answers(1, 2s);
    answers(2, 900s);
    BOOST_TEST(table.find_member("car1")->epoch == 2U);
}

BOOST_AUTO_TEST_CASE(one_that_started_after_the_owner_was_known_is_second_whatever_its_epoch) {
    receive("car1", 2, 1);
    pass(500ms);
    receive("car1", 1, 1, there);
    answers(2, 600ms);
    answers(1, 100ms);
    BOOST_TEST(table.find_member("car1")->epoch == 2U);
}

BOOST_AUTO_TEST_CASE(missing_reply_decides_nothing_if_this_node_was_suspended) {
    receive("car1", 1, 1);
    receive("car1", 2, 1, there);
    clock.advance(100s);
    table.note_suspension(clock.now());
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    receive("car1", 2, 2, there);
    BOOST_TEST(asked.size() == 2U); // again
    is_absent();
    BOOST_TEST(where("car1") == "tcp://10.0.0.8:1");
}

BOOST_AUTO_TEST_CASE(own_name_is_taken_if_another_node_had_it_first) {
    table.begin({}, clock.now());
    pass(200ms);
    receive("me", 3, 40, there);
    check(asked, {"tcp://10.0.0.8:1"});
    answers(3, 60s, "me");
    check(take_changes(), {"me clash 10.0.0.8", "me taken tcp://10.0.0.8:1"});
}

BOOST_AUTO_TEST_CASE(own_name_stays_if_this_node_was_first_or_has_the_lower_epoch) {
    pass(60s);
    receive("me", 3, 1, there);
    answers(3, 100ms, "me");
    check(take_changes(), {"me clash 10.0.0.8"});

    fixture together;
    together.pass(100ms);
    together.receive("me", 0xBBBB, 1, there); // this node's is aaaa
    together.answers(0xBBBB, 600ms, "me");
    check(together.take_changes(), {"me clash 10.0.0.8"});

    fixture lower;
    lower.pass(600ms);
    lower.receive("me", 0x0001, 1, there);
    lower.answers(0x0001, 100ms, "me");
    check(lower.take_changes(), {"me clash 10.0.0.8", "me taken tcp://10.0.0.8:1"});
}

BOOST_AUTO_TEST_CASE(previous_incarnation_of_this_node_does_not_take_the_name) {
    receive("me", 3, 40, there);
    is_absent();
    receive("me", 4, 40, there);
    BOOST_TEST(changes.empty());
    fixture same_place;
    same_place.receive("me", 3, 40, there);
    same_place.answers(0xAAAA, 10ms, "me"); // it is this node itself
    BOOST_TEST(same_place.changes.empty());
}

BOOST_AUTO_TEST_CASE(probes_are_rate_limited) {
    for (std::uint32_t i = 1; i <= 5; ++i) {
        receive("car" + std::to_string(i), i, 1);
    }
    for (std::uint32_t round = 1; round <= 1000; ++round) {
        for (std::uint32_t i = 1; i <= 5; ++i) {
            receive("car" + std::to_string(i), i, round + 1);
            table.apply_announcement(
                {.node = "car" + std::to_string(i), .endpoints = {"tcp://0.0.0.0:2"}, .interval = 250ms},
                1000 + round * 10 + i, 1, there, clock.now());
        }
        pass(100ms);
        answers(0, 1s);
    }
    BOOST_TEST(asked.size() <= 2100U); // 20 a second for 100 s, plus the burst
}

BOOST_AUTO_TEST_CASE(nodes_of_other_pools_are_not_known) {
    BOOST_TEST((receive("car1", 1, 1, here, "north") == verdict::foreign));
    BOOST_TEST(table.size() == 0U);
    table.begin("north", clock.now());
    BOOST_TEST((receive("car1", 1, 2, here, "north") == verdict::taken));
    BOOST_TEST((receive("car2", 2, 1) == verdict::foreign));
    BOOST_TEST((receive("car2", 2, 1, here, "south") == verdict::foreign));
    BOOST_TEST(
        (table.apply_gossip({.announced = {.node = "car3", .endpoints = {"tcp://10.0.0.9:1"}}, .epoch = 3, .seq = 1},
                            observed_source::of(here), clock.now(), clock.now()) == verdict::foreign));
    BOOST_TEST(table.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
