// SPDX-License-Identifier: BSL-1.0
// Membership from gossip (docs/protocol.md, "Gossip").
#include "node/membership/membership.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace membership_gossip {
namespace {

using namespace std::chrono_literals;
using cles::peer_state;
using cles::core::announcement;
using cles::core::delta_entry;
using cles::core::group_source;
using cles::core::observed_source;
using cles::core::peer_report;

constexpr group_source in_group{0x0A000009, 40000};
const auto by_other_host = observed_source::at("tcp://10.0.0.7:25370");
const auto by_this_host = observed_source::at("tcp://127.0.0.1:25370");

struct fixture : cles::test::watched_membership {
    static peer_report report(std::string node, std::uint32_t epoch, std::uint64_t seq, std::chrono::milliseconds age,
                              std::string endpoint = "tcp://10.0.0.9:1") {
        return {.announced = {.node = std::move(node), .endpoints = {std::move(endpoint)}, .tasks = "00"},
                .epoch = epoch,
                .seq = seq,
                .age = age};
    }
    verdict apply(const peer_report& r, const observed_source& by = by_other_host) {
        return table.apply_gossip(r, by, clock.now(), clock.now());
    }
    verdict beat(std::uint32_t epoch, std::uint64_t seq, std::chrono::milliseconds age) {
        return table.apply_gossip({.epoch = epoch, .seq = seq, .age = age, .interval = 1s, .queued = 3, .running = 4},
                                  clock.now(), clock.now());
    }
    verdict apply_leave(const std::string& node, std::uint32_t epoch, std::uint64_t seq,
                        std::chrono::milliseconds age = 0ms) {
        auto r = report(node, epoch, seq, age);
        r.announced.leaving = true;
        return apply(r);
    }
    [[nodiscard]] std::vector<delta_entry> deltas(std::uint64_t since = 0) const {
        return table.deltas_since(since, clock.now());
    }
};

} // namespace
} // namespace membership_gossip

BOOST_FIXTURE_TEST_SUITE(membership_gossip, fixture)

BOOST_AUTO_TEST_CASE(reported_node_is_known_with_its_age) {
    BOOST_TEST((apply(report("car1", 1, 7, 600ms)) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    BOOST_TEST((list()[0].age == 600ms));
    check(changes, {"car1 appeared tcp://10.0.0.9:1"});
}

BOOST_AUTO_TEST_CASE(ages_count_from_the_request) {
    const auto asked = clock.now();
    clock.advance(50ms);
    table.apply_gossip(report("car1", 1, 7, 600ms), by_other_host, asked, clock.now());
    BOOST_TEST((list()[0].age == 650ms));
}

BOOST_AUTO_TEST_CASE(silence_is_detected_at_the_same_time_on_any_path) {
    apply(report("car1", 1, 7, 3s));
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(500ms);
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(11'500ms);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(only_a_greater_seq_is_newer_whatever_the_age) {
    apply(report("car1", 1, 7, 600ms));
    BOOST_TEST((apply(report("car1", 1, 7, 0ms)) == verdict::old));
    BOOST_TEST((list()[0].age == 600ms));
    BOOST_TEST((apply(report("car1", 1, 6, 0ms)) == verdict::old));
    BOOST_TEST((apply(report("car1", 1, 8, 100ms)) == verdict::taken));
    BOOST_TEST((list()[0].age == 100ms));
}

BOOST_AUTO_TEST_CASE(without_a_seq_an_entry_younger_by_half_an_interval_is_newer) {
    apply(report("car1", 1, 0, 600ms));
    BOOST_TEST((apply(report("car1", 1, 0, 101ms)) == verdict::old));
    BOOST_TEST((apply(report("car1", 1, 0, 100ms)) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(heartbeat_shows_that_a_known_incarnation_is_alive) {
    BOOST_TEST((beat(1, 7, 0ms) == verdict::unknown));
    apply(report("car1", 1, 7, 600ms));
    const auto before = table.latest_revision();
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST(table.latest_revision() == before); // entries that are not newer are not relayed
    BOOST_TEST((beat(1, 8, 100ms) == verdict::taken));
    BOOST_TEST(list()[0].load.queued == 3U);
    BOOST_TEST(list()[0].load.running == 4U);
    BOOST_TEST((list()[0].age == 100ms));
    BOOST_REQUIRE(deltas(before).size() == 1U);
    BOOST_TEST((deltas(before)[0].what == delta_entry::kind::heartbeat));
    BOOST_TEST((beat(0xAAAA, 9, 0ms) == verdict::own));
}

BOOST_AUTO_TEST_CASE(suspect_that_is_reported_again_returns) {
    apply(report("car1", 1, 7, 0ms));
    pass(4s);
    take_changes();
    beat(1, 8, 200ms);
    check(take_changes(), {"car1 returned tcp://10.0.0.9:1"});
    BOOST_TEST((list()[0].state == peer_state::live));
}

BOOST_AUTO_TEST_CASE(late_last_announcement_of_a_suspect_does_not_bring_it_back) {
    apply(report("car1", 1, 7, 0ms));
    pass(4500ms);
    take_changes();
    BOOST_TEST((beat(1, 8, 3500ms) == verdict::taken));
    BOOST_TEST(changes.empty());
    BOOST_TEST((list()[0].state == peer_state::suspect));
}

BOOST_AUTO_TEST_CASE(old_entry_does_not_make_a_name_known) {
    BOOST_TEST((apply(report("car1", 1, 7, 3500ms)) == verdict::old));
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(unspecified_address_is_the_senders_and_is_relayed_as_such) {
    apply(report("car1", 1, 7, 0ms, "tcp://0.0.0.0:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.7:1");
    BOOST_TEST(deltas()[0].endpoints->front() == "tcp://10.0.0.7:1");
    apply(report("car2", 2, 7, 0ms, "tcp://0.0.0.0:1"), by_this_host);
    BOOST_TEST(where("car2") == "tcp://127.0.0.1:1");
    BOOST_TEST(deltas()[1].endpoints->front() ==
               "tcp://0.0.0.0:1"); // a node that asks this host relates it to this host
}

BOOST_AUTO_TEST_CASE(gossip_changes_endpoints_only_by_a_longer_list) {
    apply(report("car1", 1, 7, 0ms));
    apply(report("car1", 1, 8, 0ms, "tcp://10.0.0.10:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    auto more = report("car1", 1, 9, 0ms);
    more.announced.endpoints = {"tcp://10.0.0.11:1", "tcp://10.0.0.9:1"};
    apply(more);
    BOOST_TEST(where("car1") == "tcp://10.0.0.11:1");
}

BOOST_AUTO_TEST_CASE(unreachable_node_takes_the_address_reported_by_another) {
    apply(report("car1", 1, 7, 0ms, "tcp://127.0.0.1:1"));
    BOOST_TEST(where("car1").empty());
    take_changes();
    apply(report("car1", 1, 7, 0ms, "tcp://10.0.0.9:1"));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    check(take_changes(), {"car1 moved tcp://10.0.0.9:1"});
}

BOOST_AUTO_TEST_CASE(multicast_and_gossip_share_one_table) {
    table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}, .tasks = "00"}, 1, 7, in_group,
                             clock.now());
    BOOST_TEST((beat(1, 8, 100ms) == verdict::taken));
    BOOST_TEST((apply(report("car1", 1, 9, 0ms, "tcp://10.0.0.10:1")) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1"); // as it announced itself
    BOOST_TEST((table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:2"}}, 1, 10, in_group,
                                         clock.now()) == verdict::taken));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:2");
    BOOST_TEST(table.size() == 1U);
}

BOOST_AUTO_TEST_CASE(incarnation_from_gossip_is_the_announced_one_with_the_same_epoch) {
    apply(report("car1", 1, 7, 0ms, "tcp://10.0.0.10:1"));
    table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}}, 1, 8, in_group, clock.now());
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(leave_ends_an_incarnation_and_is_relayed) {
    apply(report("car1", 1, 7, 0ms));
    take_changes();
    const auto before = table.latest_revision();
    BOOST_TEST((apply_leave("car1", 1, 8) == verdict::taken));
    check(take_changes(), {"car1 left tcp://10.0.0.9:1"});
    BOOST_REQUIRE(deltas(before).size() == 1U);
    BOOST_TEST((deltas(before)[0].what == delta_entry::kind::leave));
    BOOST_TEST((apply_leave("car1", 1, 8) == verdict::old));
    BOOST_TEST((apply(report("car1", 1, 7, 100ms)) == verdict::old)); // older entries do not bring it back
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST((apply(report("car1", 1, 9, 0ms)) == verdict::taken));
}

// The reader may have received the full entry before it could accept it; from then on it receives only heartbeats.
BOOST_AUTO_TEST_CASE(later_heartbeat_of_a_removed_incarnation_needs_a_description) {
    apply(report("car1", 1, 7, 0ms));
    pass(15s);
    check(take_changes(), {"car1 appeared tcp://10.0.0.9:1", "car1 gone tcp://10.0.0.9:1"});
    BOOST_TEST((beat(1, 7, 0ms) == verdict::old));
    BOOST_TEST((beat(1, 8, 0ms) == verdict::unknown));
    BOOST_TEST((apply(report("car1", 1, 8, 0ms)) == verdict::taken));
    BOOST_TEST((beat(1, 9, 0ms) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(leave_of_an_unknown_incarnation_is_remembered_for_15_intervals) {
    apply_leave("car1", 1, 8);
    BOOST_TEST((apply(report("car1", 1, 7, 100ms)) == verdict::old));
    BOOST_TEST(deltas().size() == 1U);
    pass(15s);
    BOOST_TEST(deltas().empty());
    BOOST_TEST((apply_leave("car2", 2, 8, 15s) == verdict::old));
}

BOOST_AUTO_TEST_CASE(incarnation_received_in_the_group_ends_only_by_its_leave_there) {
    table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}}, 1, 7, in_group, clock.now());
    BOOST_TEST((apply_leave("car1", 1, 8) == verdict::old));
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    table.apply_announcement({.node = "car1", .leaving = true}, 1, 8, in_group, clock.now());
    BOOST_TEST(where("car1") == "nowhere");
}

BOOST_AUTO_TEST_CASE(restart_is_detected_by_the_epoch_and_is_not_a_conflict) {
    apply(report("car1", 1, 50, 0ms));
    pass(1s); // it was killed, and restarts
    BOOST_TEST((apply(report("car1", 2, 1, 0ms, "tcp://10.0.0.9:2")) == verdict::taken));
    BOOST_TEST((apply(report("car1", 1, 51, 800ms)) == verdict::taken)); // its last announcement arrives late
    for (std::uint64_t seq = 2; seq <= 5; ++seq) {
        pass(700ms);
        beat(2, seq, 50ms);
    }
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:2");
    check(take_changes(), {"car1 appeared tcp://10.0.0.9:1", "car1 moved tcp://10.0.0.9:2"});
    BOOST_TEST(list().size() == 1U);
}

BOOST_AUTO_TEST_CASE(two_live_nodes_of_one_name_conflict_and_both_are_reported) {
    for (std::uint64_t seq = 1; seq <= 6; ++seq) {
        apply(report("car1", 1, seq, 100ms));
        apply(report("car1", 2, seq, 100ms, "tcp://10.0.0.10:1"));
        pass(700ms);
        BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    }
    check(take_changes(), {"car1 appeared tcp://10.0.0.9:1", "car1 clash tcp://10.0.0.10:1"});
    BOOST_REQUIRE(list().size() == 2U);
    BOOST_TEST((list()[1].state == peer_state::clash));
    BOOST_TEST(deltas().size() == 2U);
    BOOST_TEST((beat(2, 7, 0ms) == verdict::taken)); // and so is a heartbeat of the second one
}

BOOST_AUTO_TEST_CASE(previous_incarnation_of_this_node_is_not_a_conflict_but_another_node_is) {
    pass(10s);
    table.announce_self({.node = "me"}, 1, clock.now());
    apply(report("me", 3, 50, 2s));
    apply(report("me", 3, 51, 1s)); // late entries of the previous incarnation
    BOOST_TEST(changes.empty());
    BOOST_TEST(table.size() == 0U);
    pass(5s);
    apply(report("me", 4, 60, 1s)); // announced while this node was running
    apply(report("me", 4, 61, 0ms));
    apply(report("me", 4, 62, 0ms));
    check(take_changes(), {"me clash tcp://10.0.0.9:1"});
    BOOST_TEST((beat(4, 63, 0ms) == verdict::taken));
}

BOOST_AUTO_TEST_CASE(suspension_of_this_node_makes_no_other_node_suspect) {
    apply(report("car1", 1, 7, 0ms));
    clock.advance(100s);
    table.note_suspension(clock.now());
    deadlines.expire(clock.now());
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(3499ms);
    BOOST_TEST((list()[0].state == peer_state::live));
    pass(1ms); // it should have been received by now
    BOOST_TEST((list()[0].state == peer_state::suspect));
    pass(11'500ms);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(own_entry_is_reported_as_announced) {
    BOOST_TEST(table.own() == nullptr);
    table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:1"}}, 1, clock.now());
    BOOST_REQUIRE(deltas().size() == 1U);
    const auto before = table.latest_revision();
    table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:1"}}, 2, clock.now());
    BOOST_REQUIRE(deltas(before).size() == 1U);
    BOOST_TEST((deltas(before)[0].what == delta_entry::kind::heartbeat));
    BOOST_TEST(deltas(before)[0].seq == 2U);
    BOOST_TEST(list().empty());
}

BOOST_AUTO_TEST_CASE(names_follow_each_other_in_a_ring) {
    BOOST_TEST(!table.next_member("me").has_value());
    apply(report("car1", 1, 1, 0ms));
    apply(report("zug", 2, 1, 0ms));
    BOOST_TEST(table.next_member("me")->node == "zug");
    BOOST_TEST(table.next_member("zug")->node == "car1");
    BOOST_TEST(table.at(1).node == "zug");
    BOOST_TEST(table.find_member("car1")->epoch == 1U);
    BOOST_TEST(!table.find_member("car9").has_value());
}

BOOST_AUTO_TEST_CASE(nodes_beyond_the_limit_are_refused) {
    for (std::uint32_t i = 1; i <= 5; ++i) {
        apply(report("car" + std::to_string(i), i, 1, 0ms));
    }
    BOOST_TEST((apply(report("car6", 6, 1, 0ms)) == verdict::refused));
}

// -- another address -----------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_node_that_has_another_address_is_asked_for_there) {
    std::vector<std::string> asked;
    std::uint64_t last = 0;
    table.set_prober([&](std::uint64_t ticket, std::string_view url) {
        last = ticket;
        asked.emplace_back(url);
    });
    const auto answers = [&](std::uint32_t epoch) {
        table.on_probed(last, {cles::core::probe_outcome::kind::answered, "car1", epoch, 1s}, clock.now());
    };
    const auto is_absent = [&] {
        table.on_probed(last, {.what = cles::core::probe_outcome::kind::absent}, clock.now());
    };
    apply(report("car1", 1, 7, 0ms));
    apply(report("car1", 1, 8, 0ms, "tcp://10.0.0.77:1")); // on this path, it has another one
    check(asked, {"tcp://10.0.0.9:1"});
    answers(1);
    pass(1s);
    apply(report("car1", 1, 9, 0ms, "tcp://10.0.0.77:1"));
    BOOST_TEST(asked.size() == 1U);
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");

    for (std::uint64_t seq = 10; seq < 15; ++seq) { // the other path has ended
        pass(1s);
        apply(report("car1", 1, seq, 0ms));
    }
    apply(report("car1", 1, 15, 0ms, "tcp://10.0.0.78:1")); // and now its address has changed
    BOOST_REQUIRE(asked.size() == 2U);
    is_absent();
    check({asked.begin() + 1, asked.end()}, {"tcp://10.0.0.9:1", "tcp://10.0.0.78:1"});
    BOOST_TEST(where("car1") == "tcp://10.0.0.9:1");
    answers(1);
    BOOST_TEST(where("car1") == "tcp://10.0.0.78:1");
    BOOST_TEST(list().size() == 1U);
    BOOST_TEST((deltas().back().what == delta_entry::kind::description)); // others learn of it
    BOOST_TEST(deltas().back().endpoints->front() == "tcp://10.0.0.78:1");
}

BOOST_AUTO_TEST_CASE(an_older_entry_with_another_address_is_no_reason_to_ask) {
    std::vector<std::string> asked;
    table.set_prober([&](std::uint64_t, std::string_view url) { asked.emplace_back(url); });
    apply(report("car1", 1, 7, 0ms));
    apply(report("car1", 1, 6, 0ms, "tcp://10.0.0.77:1"));
    apply(report("car1", 1, 8, 0ms, "unix://@car1")); // of no use here
    BOOST_TEST(asked.empty());
}

BOOST_AUTO_TEST_SUITE_END()
