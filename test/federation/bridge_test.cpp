// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge.hpp"
#include "simulated_nats.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace bridge_suite {
namespace {

using namespace std::chrono_literals;
using cles::bridging::bridge_link;
using cles::bridging::test::simulated_nats;
using cles::bridging::test::site;

/// Two pools with a bridge each, which know each other.
struct two_pools {
    simulated_nats nats{1};
    site hub{nats, "south", "hub"};
    site gate{nats, "north", "gate"};

    two_pools() {
        hub.names = {"hub", "car1"};
        gate.names = {"gate", "car1", "car9"};
        hub.connect();
        gate.connect();
        nats.run_for(2s);
    }
};

std::size_t count(const std::vector<std::string>& all, const std::string& what) {
    return static_cast<std::size_t>(std::count(all.begin(), all.end(), what));
}

bool has_words(const std::vector<std::string>& all, const std::string& words) {
    return std::any_of(all.begin(), all.end(),
                       [&words](const auto& each) { return each.find(words) != std::string::npos; });
}

} // namespace
} // namespace bridge_suite

CLES_TEST_SUITE(bridge)

BOOST_FIXTURE_TEST_CASE(bridges_find_each_other_and_learn_names, two_pools) {
    BOOST_TEST(hub.core().is_live("north"));
    BOOST_TEST(gate.core().is_live("south"));
    BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north");
    BOOST_TEST(hub.core().pool_of("north.car1", nats.now()) == "north");
    BOOST_TEST(hub.core().pool_of("south.car1", nats.now()) == "south");
    BOOST_TEST(hub.core().pool_of("nobody", nats.now()).empty());
    BOOST_TEST(hub.core().pool_of("west.car1", nats.now()).empty());
    gate.names.emplace_back("new");
    nats.run_for(2s);
    BOOST_TEST(hub.core().pool_of("new", nats.now()) == "north");
}

BOOST_AUTO_TEST_CASE(a_name_with_a_dot_is_no_pool_that_does_not_appear) {
    simulated_nats nats{1};
    site hub{nats, "south", "hub"};
    site gate{nats, "north", "gate.two"};
    hub.connect();
    BOOST_TEST(hub.core().pool_of("gate.two", nats.now()) == "gate"); // until others have answered
    const auto before = hub.pools_changed;
    nats.run_for(2s);
    BOOST_TEST(hub.pools_changed == before + 1); // the node asks again
    BOOST_TEST(hub.core().pool_of("gate.two", nats.now()).empty());
    gate.connect();
    nats.run_for(500ms);
    BOOST_TEST(hub.core().pool_of("gate.two", nats.now()) == "north");
    BOOST_TEST(gate.core().pool_of("hub", nats.now()) == "south");
    BOOST_TEST(gate.core().pool_of("gate.two", nats.now()) == "gate"); // just connected; at home, the node knows it
}

BOOST_FIXTURE_TEST_CASE(a_heartbeat_measures_the_way_to_the_server_and_back, two_pools) {
    BOOST_TEST(hub.core().round_trip().has_value());
    nats.impair().longest_delay = 20ms;
    nats.run_for(2s);
    BOOST_TEST((hub.core().round_trip() > 0ms && hub.core().round_trip() <= 20ms));
    nats.lose = [](const std::string& subject, const std::string&) { return subject.starts_with("cles.south.beat"); };
    hub.disconnect();
    hub.connect();
    nats.run_for(2s);
    BOOST_TEST(!hub.core().round_trip().has_value());
}

BOOST_FIXTURE_TEST_CASE(a_request_crosses, two_pools) {
    const auto id = hub.ask("north", "PUSH north.car9:echo/fast deadline=900 hops=7 via=hub {\"n\":1}");
    nats.run_for(1ms);
    BOOST_TEST(hub.answer(id) == "{\"n\":1}");
    BOOST_TEST(gate.executed["{\"n\":1}"] == 1);
    const auto sent = nats.recorded("cles.north.push");
    BOOST_REQUIRE(sent.size() == 1U);
    BOOST_TEST(sent[0] == "cles.north.push.car9.echo /fast deadline=900 hops=7 via=south.hub {\"n\":1}");
    // It was answered at once, so it was not acknowledged.
    const auto answers = nats.recorded("cles.south.bridge");
    BOOST_TEST(has_words(answers, ".1 {\"n\":1}"));
    BOOST_TEST(!has_words(answers, "taken="));
}

BOOST_FIXTURE_TEST_CASE(what_takes_time_is_acknowledged, two_pools) {
    gate.answer_after = 100ms;
    const auto id = hub.ask("north", "DELEGATE car9:echo progress=yes {\"n\":1}");
    nats.run_for(50ms);
    BOOST_TEST(has_words(nats.recorded("cles.south.bridge"), "taken=" + gate.core().self().instance));
    BOOST_TEST(hub.answer(id).empty());
    gate.core().on_line({bridge_link::role::from_pool, "south"}, "id=1 progress=0.5 {}", nats.now());
    nats.run_for(1ms);
    BOOST_TEST(hub.answer(id) == "progress=0.5 {}");
    nats.run_for(100ms);
    BOOST_TEST(hub.answer(id) == "{\"n\":1}");
    BOOST_TEST(hub.answers[id].size() == 2U);
}

BOOST_FIXTURE_TEST_CASE(a_cancellation_reaches_who_took_the_request, two_pools) {
    gate.answer_after = 1s;
    const auto id = hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    nats.run_for(10ms);
    hub.cancel("north", id);
    nats.run_for(10ms);
    BOOST_TEST(count(gate.cancelled, "{\"n\":1}") == 1U);
    BOOST_TEST(hub.answers[id].empty()); // the node has completed it by itself
}

BOOST_FIXTURE_TEST_CASE(a_cancellation_waits_for_the_acknowledgement, two_pools) {
    gate.answer_after = 1s;
    nats.impair().longest_delay = 20ms;
    const auto id = hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    hub.cancel("north", id);
    BOOST_TEST(!has_words(nats.recorded("cles.north.bridge"), "cancel"));
    nats.run_for(100ms);
    BOOST_TEST(count(gate.cancelled, "{\"n\":1}") == 1U);
    BOOST_TEST(hub.answers[id].empty());
}

BOOST_FIXTURE_TEST_CASE(without_acknowledgement_a_request_is_unavailable, two_pools) {
    nats.lose = [](const std::string& subject, const std::string&) { return subject.starts_with("cles.north.pull"); };
    const auto id = hub.ask("north", "PULL car9:echo");
    nats.run_for(1900ms);
    BOOST_TEST(hub.answer(id).empty());
    nats.run_for(700ms);
    BOOST_TEST(hub.answer(id) ==
               R"({"error":"unavailable","message":"no bridge of the pool 'north' acknowledged the request"})");
}

BOOST_FIXTURE_TEST_CASE(who_acknowledges_too_late_is_told_to_cancel, two_pools) {
    gate.answer_after = 10s;
    std::vector<std::string> held;
    bool holds = true;
    nats.lose = [&](const std::string& subject, const std::string& message) {
        if (holds && subject.starts_with("cles.south.bridge") && message.starts_with("taken=")) {
            held.push_back(subject + "|" + message);
            return true;
        }
        return false;
    };
    const auto id = hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    nats.run_for(3s);
    BOOST_TEST(hub.answer(id).starts_with(R"({"error":"unavailable")"));
    BOOST_REQUIRE(held.size() == 1U);
    BOOST_TEST(gate.cancelled.empty());
    holds = false;
    const auto bar = held[0].find('|');
    nats.publish(held[0].substr(0, bar), {}, held[0].substr(bar + 1));
    nats.run_for(10ms);
    BOOST_TEST(count(gate.cancelled, "{\"n\":1}") == 1U);
    BOOST_TEST(hub.answers[id].size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(what_a_lost_bridge_took_is_unavailable, two_pools) {
    site second{nats, "north", "second"};
    second.connect();
    nats.run_for(2s);
    gate.answer_after = 60s;
    second.answer_after = 60s;
    std::vector<std::uint64_t> ids;
    ids.reserve(20);
    for (int i = 0; i < 20; ++i) {
        ids.push_back(hub.ask("north", "DELEGATE car9:echo {\"n\":" + std::to_string(i) + "}"));
    }
    nats.run_for(100ms);
    const auto at_gate = gate.executed.size();
    BOOST_TEST(at_gate + second.executed.size() == 20U);
    BOOST_TEST(at_gate != 0U);
    BOOST_TEST(second.executed.size() != 0U);
    gate.restart(); // without a word
    nats.run_for(1900ms);
    const auto lost = std::count_if(ids.begin(), ids.end(), [&](auto id) {
        return hub.answer(id).starts_with(
            R"({"error":"unavailable","message":"the bridge of the pool 'north' was not)");
    });
    BOOST_TEST(static_cast<std::size_t>(lost) == at_gate);
    BOOST_TEST(hub.lost.empty()); // the link continues
    gate.connect();
    nats.run_for(100ms);
    BOOST_TEST(hub.core().is_live("north"));
}

BOOST_FIXTURE_TEST_CASE(the_last_bridge_of_a_pool_takes_the_link_with_it, two_pools) {
    gate.core().leave(nats.now());
    gate.core().say_left(nats.now());
    nats.run_for(10ms);
    BOOST_TEST(!hub.core().is_live("north"));
    BOOST_TEST(count(hub.lost, "pool north") == 1U);
}

BOOST_FIXTURE_TEST_CASE(a_bridge_that_leaves_completes_what_it_has_taken, two_pools) {
    gate.answer_after = 5s;
    const auto id = hub.ask("north", "DELEGATE car9:echo deadline=10000 {\"n\":1}");
    nats.run_for(10ms);
    gate.core().leave(nats.now());
    BOOST_TEST(!gate.subscribes("cles.north.push.car9.echo", true));
    nats.run_for(6s);
    BOOST_TEST(hub.answer(id) == "{\"n\":1}");
    gate.core().say_left(nats.now());
    nats.run_for(10ms);
    BOOST_TEST(!hub.core().is_live("north"));
}

BOOST_FIXTURE_TEST_CASE(requests_of_a_lost_bridge_are_cancelled, two_pools) {
    gate.answer_after = 60s;
    hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    nats.run_for(10ms);
    hub.restart();
    nats.run_for(2s);
    BOOST_TEST(count(gate.cancelled, "{\"n\":1}") == 1U);
}

BOOST_FIXTURE_TEST_CASE(a_new_connection_replaces_the_old_one_at_once, two_pools) {
    gate.answer_after = 60s;
    const auto id = hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    nats.run_for(10ms);
    gate.disconnect();
    gate.connect();
    nats.run_for(10ms);
    BOOST_TEST(count(hub.lost, "pool north") == 1U); // the node's requests end with the link
    BOOST_TEST(hub.answer(id).empty());
    BOOST_TEST(hub.core().is_live("north"));
}

BOOST_FIXTURE_TEST_CASE(a_message_that_arrives_twice_runs_once, two_pools) {
    nats.impair().repetition = 1;
    const auto id = hub.ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(gate.executed["{\"n\":1}"] == 1);
    BOOST_TEST(hub.answers[id].size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(several_bridges_share_the_requests, two_pools) {
    site second{nats, "north", "second"};
    second.connect();
    nats.run_for(2s);
    for (int i = 0; i < 100; ++i) {
        hub.ask("north", "PUSH car9:echo {\"n\":" + std::to_string(i) + "}");
    }
    nats.run_for(10ms);
    BOOST_TEST(gate.executed.size() + second.executed.size() == 100U);
    BOOST_TEST(gate.executed.size() > 20U);
    BOOST_TEST(second.executed.size() > 20U);
}

BOOST_FIXTURE_TEST_CASE(a_request_that_has_been_in_the_pool_is_refused, two_pools) {
    const auto id = hub.ask("north", "PULL car9:echo via=north.gate,hub");
    nats.run_for(10ms);
    // The name is of this pool as it is written by the node; as a pool's node it has passed before.
    BOOST_TEST(nats.recorded("cles.north.pull")[0] == "cles.north.pull.car9.echo  via=south.north.gate,south.hub");
    BOOST_TEST(hub.answer(id) == "{}");
    nats.publish("cles.north.pull.car9.echo", "cles.south.bridge." + hub.core().self().instance + ".77",
                 " via=north.gate,south.hub");
    nats.run_for(10ms);
    const auto answers = nats.recorded("cles.south.bridge." + hub.core().self().instance + ".77");
    BOOST_REQUIRE(answers.size() == 1U);
    BOOST_TEST(answers[0].find(R"({"error":"no_target")") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(a_request_from_another_pool_is_not_sent_on, two_pools) {
    for (const std::string via : {"south.nats,south.hub,gate", "south.gate,program.nats"}) {
        const auto id = hub.ask("north", "PUSH car9:echo via=" + via);
        nats.run_for(10ms);
        BOOST_TEST(hub.answer(id).find(R"({"error":"no_target")") == 0U);
    }
    BOOST_TEST(nats.published("push") == 0U);
}

BOOST_FIXTURE_TEST_CASE(within_its_own_pool_a_qualified_name_works, two_pools) {
    const auto id = hub.ask("south", "PUSH south.car1:echo via=hub {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id) == "{\"n\":1}");
    BOOST_TEST(hub.executed["{\"n\":1}"] == 1);
    // The node would take its own name in `via` for a loop.
    const auto self = hub.ask("south", "PUSH south.hub:echo via=hub {\"n\":2}");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(self) == "{\"n\":2}");
    BOOST_TEST(nats.recorded("cles.south.push.hub")[0] == "cles.south.push.hub.echo  {\"n\":2}");
}

BOOST_FIXTURE_TEST_CASE(programs_that_use_nats_are_served, two_pools) {
    nats.publish("cles.north.push.car9.echo", "_INBOX.abc", "{\"n\":1}");
    nats.publish("cles.north.pull.car9.echo", "_INBOX.def", "");
    nats.run_for(10ms);
    BOOST_TEST((nats.recorded("_INBOX.abc") == std::vector<std::string>{"_INBOX.abc {\"n\":1}"}));
    BOOST_TEST((nats.recorded("_INBOX.def") == std::vector<std::string>{"_INBOX.def {}"}));
    // Not acknowledged, even if it takes time.
    gate.answer_after = 10ms;
    nats.publish("cles.north.push.car9.echo", "_INBOX.ghi", "{\"n\":2}");
    nats.run_for(20ms);
    BOOST_TEST((nats.recorded("_INBOX.ghi") == std::vector<std::string>{"_INBOX.ghi {\"n\":2}"}));
}

// Permissions of NATS, which state verb, node and task, do not cover the subject of a bridge.
BOOST_FIXTURE_TEST_CASE(a_request_on_the_subject_of_a_bridge_needs_security, two_pools) {
    nats.publish("cles.north.bridge." + gate.core().self().instance + ".request", "_INBOX.abc", "PUSH car9:echo {}");
    nats.run_for(10ms);
    BOOST_TEST(gate.executed.empty());
    BOOST_TEST(gate.core().counted().messages_refused == 1U);
    BOOST_TEST(nats.recorded("_INBOX.").empty());
}

BOOST_FIXTURE_TEST_CASE(what_concerns_a_link_does_not_cross, two_pools) {
    for (const std::string subject :
         {"cles.north.push.self.cles", "cles.north.push.gate.cles", "cles.north.pull.self.speed"}) {
        nats.publish(subject, "_INBOX.x", "/cancel/1");
        nats.run_for(10ms);
        const auto answers = nats.recorded("_INBOX.x");
        BOOST_REQUIRE(!answers.empty());
        BOOST_TEST(answers.back().find(R"({"error":"no_target")") != std::string::npos, subject);
    }
    BOOST_TEST(gate.logged.empty());
}

BOOST_FIXTURE_TEST_CASE(foreign_messages_are_dropped_and_logged_once, two_pools) {
    nats.publish("cles.north.push.car9.echo", "", "{\"n\":1}\nPUSH car9:echo {\"n\":2}");
    nats.publish("cles.north.push.car9.echo", "", "x:y {}");
    nats.publish("cles.north.beat.0123456789abcdef", "", "hello");
    nats.publish("cles.north.names.0123456789abcdef", "", "{}");
    nats.publish("cles.north.bridge." + gate.core().self().instance + ".control", "x", "PUSH self:cles/lost");
    nats.publish("cles.north.bridge." + gate.core().self().instance + ".99", "", "{\"n\":1}");
    nats.publish("cles.north.bind.car9.echo", "_INBOX.b", "");
    nats.run_for(10ms);
    BOOST_TEST(gate.executed.empty());
    BOOST_TEST(gate.logged.size() == 1U);
    BOOST_TEST(gate.core().counted().messages_refused == 4U);
    BOOST_TEST(has_words(nats.recorded("_INBOX.b"), "bad_request"));
    BOOST_TEST(gate.core().is_live("south"));
}

BOOST_FIXTURE_TEST_CASE(a_message_with_a_line_feed_does_not_reach_the_node, two_pools) {
    gate.answer_after = 1s;
    const auto id = hub.ask("north", "DELEGATE car9:echo {\"n\":1}");
    nats.run_for(10ms);
    nats.publish("cles.south.bridge." + hub.core().self().instance + ".1", "", "{\"value\":\n12}");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id) == R"({"error":"failed","message":"the reply that came through NATS is not one line"})");
    BOOST_TEST(count(gate.cancelled, "{\"n\":1}") == 1U);
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    nats.publish("cles.north.feed.car9.speed", "", " seq=1 epoch=5f3a09c1 {\"n\":\n1}");
    nats.publish("cles.north.push.car9.echo", "_INBOX.x", "{\"n\":\n2}");
    nats.run_for(10ms);
    BOOST_TEST(hub.updates.empty());
    BOOST_TEST(has_words(nats.recorded("_INBOX.x"), "bad_request"));
    BOOST_TEST(hub.core().counted().messages_refused == 2U);
    BOOST_TEST(gate.core().counted().messages_refused == 1U);
}

BOOST_FIXTURE_TEST_CASE(what_is_too_long_is_refused, two_pools) {
    const auto id = hub.ask("north", "PUSH car9:echo {\"n\":\"" + std::string(70'000, 'x') + "\"}");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id).starts_with(R"({"error":"too_large")"));
    nats.publish("cles.north.push.car9.echo", "_INBOX.x", "{\"n\":\"" + std::string(70'000, 'x') + "\"}");
    nats.run_for(10ms);
    BOOST_TEST(has_words(nats.recorded("_INBOX.x"), "too_large"));
    gate.answer_after = 50ms;
    const auto late = hub.ask("north", "PULL car9:echo");
    nats.run_for(10ms);
    gate.core().on_line({bridge_link::role::from_pool, "south"}, "id=1 {\"n\":\"" + std::string(70'000, 'x') + "\"}",
                        nats.now());
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(late).starts_with(R"({"error":"too_large")"));
    BOOST_TEST(hub.answer(late).find(R"("ran":true)") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(a_reply_for_which_there_is_no_room_is_a_failure, two_pools) {
    gate.answer_after = 50ms;
    const auto id = hub.ask("north", "PUSH car9:echo {\"n\":1}");
    const auto refused = hub.ask("north", "PUSH car9:echo {\"n\":2}");
    nats.run_for(10ms);
    gate.is_full = true;
    gate.core().on_line({bridge_link::role::from_pool, "south"}, R"(id=2 {"error":"new","x":1})", nats.now());
    nats.run_for(2s);
    BOOST_TEST(hub.answer(id).starts_with(R"({"error":"busy")"));
    BOOST_TEST(hub.answer(id).find(R"("ran":true)") != std::string::npos);
    BOOST_TEST(hub.answer(refused) == R"({"error":"new","x":1})");
    BOOST_TEST(hub.core().is_live("north"));
    const auto bind = hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(bind) == "{}");
}

BOOST_FIXTURE_TEST_CASE(a_reply_that_is_too_long_here_fails_the_request, two_pools) {
    gate.answer_after = 1s;
    const auto id = hub.ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    nats.publish("cles.south.bridge." + hub.core().self().instance + ".1", "", std::string(70'000, 'x'));
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id).starts_with(R"({"error":"too_large")"));
    BOOST_TEST(hub.answer(id).find(R"("ran":true)") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(the_link_answers_what_the_node_asks_itself, two_pools) {
    const auto id = hub.ask("north", "PULL self:cles");
    BOOST_TEST(hub.answer(id) == R"({"pool":"north","protocol":1,"features":["mark"]})");
    BOOST_TEST(hub.answer(hub.ask("north", "PULL self:speed")).starts_with(R"({"error":"no_target")"));
}

// -- bindings ------------------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(updates_are_published_once_whoever_is_bound, two_pools) {
    std::vector<std::unique_ptr<site>> others;
    for (int i = 0; i < 10; ++i) {
        others.push_back(std::make_unique<site>(nats, "pool" + std::to_string(i), "hub"));
        others.back()->connect();
    }
    nats.run_for(2s);
    for (const auto& each : others) {
        const auto id = each->ask("north", "BIND car9:speed mark=yes");
        nats.run_for(10ms);
        BOOST_TEST(each->answer(id) == "{}");
    }
    BOOST_TEST(gate.bound.contains("car9:speed"));
    const auto before = nats.published("feed");
    for (std::uint64_t seq = 1; seq <= 5; ++seq) {
        gate.update("car9:speed", seq);
    }
    nats.run_for(10ms);
    BOOST_TEST(nats.published("feed") - before == 5U);
    for (const auto& each : others) {
        BOOST_TEST(each->updates.size() == 5U);
        BOOST_TEST(each->updates[4] == "UPDATE car9:speed seq=5 epoch=5f3a09c1 {\"n\":5}");
        each->ask("north", "BIND car9:speed lease=0");
    }
    nats.run_for(10ms);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
}

BOOST_FIXTURE_TEST_CASE(updates_that_cannot_be_sent_are_counted, two_pools) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    gate.update("car9:speed", 1);
    gate.is_full = true;
    gate.update("car9:speed", 2);
    gate.update("car9:speed", 3);
    gate.is_full = false;
    gate.core().on_line({bridge_link::role::publications},
                        "UPDATE car9:speed seq=4 epoch=5f3a09c1 [\"" + std::string(70'000, 'x') + "\"]", nats.now());
    gate.update("car9:speed", 5);
    nats.run_for(10ms);
    BOOST_TEST(gate.core().counted().updates_sent == 2U);
    BOOST_TEST(gate.core().counted().updates_dropped == 3U);
    BOOST_TEST(hub.updates.size() == 2U);
}

BOOST_FIXTURE_TEST_CASE(a_noun_is_bound_under_several_names, two_pools) {
    hub.ask("north", "BIND car9:speed");
    hub.ask("north", "BIND north.car9:speed");
    hub.ask("north", "BIND car9:speed/fast", 2);
    nats.run_for(10ms);
    gate.update("car9:speed", 1);
    gate.update("car9:speed/fast", 7);
    nats.run_for(10ms);
    BOOST_TEST((hub.updates == std::vector<std::string>{"UPDATE car9:speed seq=1 epoch=5f3a09c1 {\"n\":1}",
                                                        "UPDATE north.car9:speed seq=1 epoch=5f3a09c1 {\"n\":1}",
                                                        "UPDATE car9:speed/fast seq=7 epoch=5f3a09c1 {\"n\":7}"}));
    hub.ask("north", "BIND car9:speed lease=0");
    nats.run_for(10ms);
    gate.update("car9:speed", 2);
    nats.run_for(10ms);
    BOOST_TEST(hub.updates.back() == "UPDATE north.car9:speed seq=2 epoch=5f3a09c1 {\"n\":2}");
    hub.ask("north", "BIND north.car9:speed lease=0");
    nats.run_for(10ms);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
    BOOST_TEST(gate.bound.contains("car9:speed/fast"));
}

BOOST_FIXTURE_TEST_CASE(no_update_precedes_the_reply, two_pools) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    std::vector<std::pair<std::string, std::string>> replies;
    nats.lose = [&](const std::string& subject, const std::string& message) {
        if (subject.starts_with("cles.south.bridge")) {
            replies.emplace_back(subject, message);
            return true;
        }
        return false;
    };
    const auto id = hub.ask("north", "BIND north.car9:speed");
    nats.run_for(10ms);
    gate.update("car9:speed", 1);
    nats.run_for(10ms);
    BOOST_TEST(hub.updates.size() == 1U);
    BOOST_TEST(hub.answer(id).empty());
    nats.lose = nullptr;
    for (const auto& [subject, message] : replies) {
        nats.publish(subject, {}, message);
    }
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id) == "{}");
    BOOST_REQUIRE(hub.updates.size() == 2U);
    BOOST_TEST(hub.updates[1] == "UPDATE north.car9:speed seq=1 epoch=5f3a09c1 {\"n\":1}");
}

BOOST_FIXTURE_TEST_CASE(a_binding_that_is_refused_leaves_nothing, two_pools) {
    const auto id = hub.ask("north", "BIND car9:none");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(id) == R"({"error":"no_task","message":"no BIND 'none'"})");
    BOOST_TEST(!hub.subscribes("cles.north.feed.car9.none", false));
    BOOST_TEST(hub.answer(hub.ask("north", "BIND north.all:speed")).starts_with(R"({"error":"no_target")"));
}

BOOST_FIXTURE_TEST_CASE(one_bridge_of_the_pool_publishes_a_noun, two_pools) {
    site second{nats, "north", "second"};
    site west{nats, "west", "well"};
    second.connect();
    west.connect();
    nats.run_for(2s);
    for (int i = 0; i < 10; ++i) {
        const auto noun = "car9:n" + std::to_string(i);
        hub.ask("north", "BIND " + noun);
        west.ask("north", "BIND " + noun);
        nats.run_for(10ms);
        BOOST_TEST(gate.bound.contains(noun) != second.bound.contains(noun), noun);
    }
    BOOST_TEST(gate.bound.size() + second.bound.size() == 10U);
}

BOOST_FIXTURE_TEST_CASE(when_the_publishing_bridge_is_lost_the_node_binds_again, two_pools) {
    site second{nats, "north", "second"};
    second.connect();
    nats.run_for(2s);
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    auto& publisher = gate.bound.empty() ? second : gate;
    auto& other = gate.bound.empty() ? gate : second;
    publisher.restart();
    nats.run_for(2s);
    BOOST_TEST(count(hub.lost, "binding car9:speed") == 1U);
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    BOOST_TEST(other.bound.contains("car9:speed"));
    other.update("car9:speed", 9);
    nats.run_for(10ms);
    BOOST_TEST(hub.updates.back() == "UPDATE car9:speed seq=9 epoch=5f3a09c1 {\"n\":9}");
}

BOOST_FIXTURE_TEST_CASE(what_other_bridges_hold_stays_bound_when_one_is_lost, two_pools) {
    site second{nats, "north", "second"};
    second.connect();
    nats.run_for(2s);
    for (int i = 0; i < 10; ++i) {
        hub.ask("north", "BIND car9:n" + std::to_string(i));
    }
    nats.run_for(10ms);
    const auto held = gate.bound;
    BOOST_REQUIRE(!held.empty());
    BOOST_REQUIRE(!second.bound.empty());
    gate.restart();
    nats.run_for(2s);
    BOOST_TEST(hub.lost.size() == held.size());
    BOOST_TEST(second.bound.size() == 10U - held.size());
    for (int i = 0; i < 10; ++i) {
        const auto noun = "car9:n" + std::to_string(i);
        BOOST_TEST(count(hub.lost, "binding " + noun) == held.count(noun));
        second.update(noun, 5);
        nats.run_for(10ms);
        BOOST_TEST(has_words(hub.updates, "UPDATE " + noun + " ") != held.contains(noun), noun);
        BOOST_TEST(hub.subscribes("cles.north.feed.car9.n" + std::to_string(i), false) != held.contains(noun));
    }
}

BOOST_FIXTURE_TEST_CASE(the_bindings_of_a_lost_bridge_end, two_pools) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    BOOST_TEST(gate.bound.contains("car9:speed"));
    hub.restart();
    nats.run_for(2s);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
}

BOOST_FIXTURE_TEST_CASE(who_was_taken_for_lost_is_told, two_pools) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    const auto beats = "cles.south.beat." + hub.core().self().instance;
    nats.lose = [&](const std::string& subject, const std::string&) { return subject == beats; };
    nats.run_for(2s);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
    BOOST_TEST(hub.lost.empty());
    nats.lose = nullptr;
    nats.run_for(1s);
    BOOST_TEST(count(hub.lost, "pool north") + count(hub.lost, "binding car9:speed") == 1U);
    BOOST_TEST(hub.core().is_live("north"));
}

// Bridges of earlier versions know no line that says it of a single binding.
BOOST_FIXTURE_TEST_CASE(when_the_node_closes_the_link_of_publications_all_is_bound_again, two_pools) {
    for (const auto* const noun : {"car9:speed", "car9:pose"}) {
        hub.ask("north", std::string{"BIND "} + noun);
    }
    nats.run_for(10ms);
    const auto publications = *gate.bound_on.at("car9:speed").begin();
    gate.close(publications);
    nats.run_for(10ms);
    BOOST_TEST(gate.bound.empty());
    const auto told = nats.recorded("cles.south.bridge." + hub.core().self().instance + ".control");
    BOOST_TEST(has_words(told, "PUSH self:cles/lost"));
    BOOST_TEST(!has_words(told, "unbound"));
    for (const auto* const noun : {"car9:speed", "car9:pose"}) {
        BOOST_TEST(count(hub.lost, std::string{"binding "} + noun) == 1U, noun);
        hub.ask("north", std::string{"BIND "} + noun);
    }
    nats.run_for(10ms);
    BOOST_TEST(gate.bound.size() == 2U);
}

BOOST_FIXTURE_TEST_CASE(a_binding_ended_before_its_reply_does_not_remain, two_pools) {
    nats.impair().longest_delay = 5ms;
    hub.ask("north", "BIND car9:speed");
    hub.ask("north", "BIND car9:speed lease=0");
    nats.run_for(100ms);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
}

// Holds back what comes from the pool north, and lets it pass later.
struct slow_replies : two_pools {
    std::vector<std::pair<std::string, std::string>> held;

    slow_replies() {
        nats.lose = [this](const std::string& subject, const std::string& message) {
            const bool is_reply = subject.starts_with("cles.south.bridge") && !subject.ends_with("control");
            if (is_reply) {
                held.emplace_back(subject, message);
            }
            return is_reply;
        };
    }
    void pass() {
        nats.lose = nullptr;
        for (const auto& [subject, message] : std::exchange(held, {})) {
            nats.publish(subject, {}, message);
        }
        nats.run_for(10ms);
    }
};

BOOST_FIXTURE_TEST_CASE(a_binding_that_is_cancelled_does_not_remain, slow_replies) {
    const auto id = hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    hub.cancel("north", id);
    BOOST_TEST(!hub.subscribes("cles.north.feed.car9.speed", false));
    BOOST_TEST(gate.bound.contains("car9:speed"));
    pass();
    BOOST_TEST(!gate.bound.contains("car9:speed"));
    BOOST_TEST(hub.answers[id].empty());
}

BOOST_FIXTURE_TEST_CASE(a_binding_of_a_link_that_is_closed_does_not_remain, slow_replies) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    hub.core().on_closed({bridge_link::role::to_pool, "north", 1});
    pass();
    BOOST_TEST(!gate.bound.contains("car9:speed"));
}

BOOST_FIXTURE_TEST_CASE(a_binding_that_is_acknowledged_too_late_does_not_remain, slow_replies) {
    const auto id = hub.ask("north", "BIND car9:speed deadline=60000");
    nats.run_for(3s);
    BOOST_TEST(hub.answer(id).starts_with(R"({"error":"unavailable")"));
    pass();
    BOOST_TEST(!gate.bound.contains("car9:speed"));
}

BOOST_FIXTURE_TEST_CASE(a_binding_whose_reply_is_lost_does_not_remain, slow_replies) {
    hub.ask("north", "BIND car9:speed deadline=1000");
    nats.run_for(10ms);
    BOOST_REQUIRE(held.size() == 2U); // the acknowledgement and the reply
    held.pop_back();
    pass();
    nats.run_for(3s);
    BOOST_TEST(!gate.bound.contains("car9:speed"));
    BOOST_TEST(!hub.subscribes("cles.north.feed.car9.speed", false));
}

BOOST_FIXTURE_TEST_CASE(another_binding_of_the_noun_survives_a_cancellation, two_pools) {
    hub.ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    nats.impair().longest_delay = 5ms;
    const auto id = hub.ask("north", "BIND north.car9:speed");
    hub.cancel("north", id);
    nats.run_for(100ms);
    BOOST_TEST(gate.bound.contains("car9:speed"));
    gate.update("car9:speed", 1);
    nats.run_for(10ms);
    BOOST_TEST((hub.updates == std::vector<std::string>{"UPDATE car9:speed seq=1 epoch=5f3a09c1 {\"n\":1}"}));
}

// -- the pools -----------------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(two_sites_with_one_name_are_reported, two_pools) {
    site other{nats, "north", "stranger"};
    other.connect();
    nats.run_for(9s);
    BOOST_TEST(gate.logged.empty());
    nats.run_for(30s);
    BOOST_REQUIRE(gate.logged.size() == 1U);
    BOOST_TEST(gate.logged[0].find("'stranger' is of the pool 'north' too") != std::string::npos);
    BOOST_TEST(hub.logged.empty());
}

BOOST_FIXTURE_TEST_CASE(a_pool_is_forgotten_an_hour_after_its_last_bridge, two_pools) {
    gate.disconnect();
    nats.run_for(59min);
    BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north");
    nats.run_for(2min);
    BOOST_TEST(hub.core().pool_of("car9", nats.now()).empty());
    BOOST_TEST(!hub.core().pools().is_known("north"));
    gate.connect();
    nats.run_for(1s);
    BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north");
    // Without a connection, nothing can be known of the others.
    hub.disconnect();
    nats.run_for(120min);
    nats.impair().longest_delay = 5ms;
    hub.connect();
    hub.core().on_time(nats.now());
    BOOST_TEST(hub.core().pools().is_known("north"));
}

BOOST_AUTO_TEST_CASE(pools_without_bridges_make_room) {
    cles::bridging::pool_table table;
    const cles::bridging::heartbeat said{.node = "gate"};
    const cles::time_point now{1h};
    for (std::size_t i = 0; i < table.max_pools; ++i) {
        table.on_heartbeat({"p" + std::to_string(i), "0123456789abcdef"}, said, now);
    }
    using arrival = cles::bridging::pool_table::arrival;
    BOOST_TEST((table.on_heartbeat({"new", "0123456789abcdef"}, said, now) == arrival::ignored));
    table.remove({"p7", "0123456789abcdef"}, now + 2s);
    table.remove({"p9", "0123456789abcdef"}, now + 1s);
    BOOST_TEST((table.on_heartbeat({"new", "0123456789abcdef"}, said, now + 3s) == arrival::fresh));
    BOOST_TEST(table.is_known("p7"));
    BOOST_TEST(!table.is_known("p9"));
}

BOOST_FIXTURE_TEST_CASE(a_pool_has_the_nodes_that_any_of_its_bridges_sees, two_pools) {
    site second{nats, "north", "second"};
    second.names = {"second", "car8"};
    second.connect();
    nats.run_for(2s);
    const auto asked = nats.published("names");
    const auto changed = hub.pools_changed;
    for (int i = 0; i < 10; ++i) {
        nats.run_for(700ms);
        BOOST_TEST(hub.core().pool_of("car8", nats.now()) == "north");
        BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north");
    }
    BOOST_TEST(nats.published("names") == asked);
    BOOST_TEST(hub.pools_changed == changed);
    BOOST_TEST(hub.core().pools().node_count(hub.core().pools().pools().find("north")->second) == 5U);
    second.names = {"second", "car7"};
    nats.run_for(2s);
    BOOST_TEST(hub.core().pool_of("car7", nats.now()) == "north");
    BOOST_TEST(hub.core().pool_of("car8", nats.now()).empty());
    second.restart();
    nats.run_for(2s);
    BOOST_TEST(hub.core().pool_of("car7", nats.now()).empty());
    BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north");
}

BOOST_FIXTURE_TEST_CASE(a_suspension_is_no_loss, two_pools) {
    // The hub did not run for a minute: it has received nothing, and is late.
    const auto later = nats.now() + 60s;
    hub.core().on_time(later);
    BOOST_TEST(hub.core().is_live("north"));
}

BOOST_FIXTURE_TEST_CASE(a_new_connection_begins_anew, two_pools) {
    hub.ask("north", "BIND car9:speed");
    const auto id = hub.ask("north", "PULL car9:echo");
    hub.disconnect();
    BOOST_TEST(count(hub.lost, "all") == 1U);
    BOOST_TEST(!hub.core().is_live("north"));
    BOOST_TEST(hub.core().pool_of("car9", nats.now()) == "north"); // it will be again
    nats.run_for(5s);
    hub.connect();
    nats.run_for(100ms);
    BOOST_TEST(hub.answers[id].empty());
    BOOST_TEST(hub.core().is_live("north"));
    BOOST_TEST(gate.core().is_live("south"));
    BOOST_TEST(gate.core().pools().bridge_count() == 2U);
    const auto again = hub.ask("north", "PULL car9:echo");
    nats.run_for(10ms);
    BOOST_TEST(hub.answer(again) == "{}");
}

// -- a bridge that leaves ------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(a_bridge_that_leaves_waits_for_what_the_server_has_sent, two_pools) {
    nats.impair() = {.shortest_delay = 30ms, .longest_delay = 30ms};
    const auto id = hub.ask("north", "PUSH car9:echo {\"n\":1}");
    gate.core().leave(nats.now());
    BOOST_TEST(!gate.core().has_drained());
    nats.run_for(29ms);
    BOOST_TEST(!gate.core().has_drained());
    nats.run_for(1ms);
    BOOST_TEST(gate.core().has_drained());
    nats.run_for(100ms);
    BOOST_TEST(hub.answer(id) == "{\"n\":1}");
}

BOOST_FIXTURE_TEST_CASE(it_waits_for_half_a_second_at_most, two_pools) {
    nats.lose = [](const std::string&, const std::string&) { return true; };
    const auto begun = nats.now();
    gate.core().leave(begun);
    gate.core().on_time(begun + 499ms);
    BOOST_TEST(!gate.core().has_drained());
    BOOST_TEST((gate.core().due() <= begun + 500ms));
    gate.core().on_time(begun + 500ms);
    BOOST_TEST(gate.core().has_drained());
    gate.disconnect();
    gate.restart();
    gate.core().leave(nats.now()); // not connected: the server has nothing for it
    BOOST_TEST(gate.core().has_drained());
}

BOOST_FIXTURE_TEST_CASE(a_pool_has_left_when_its_last_bridge_has_left, two_pools) {
    site second{nats, "north", "second"};
    second.connect();
    nats.run_for(2s);
    BOOST_TEST(!hub.core().has_left("north"));
    gate.core().say_left(nats.now());
    nats.run_for(10ms);
    BOOST_TEST(!hub.core().has_left("north"));
    second.core().say_left(nats.now());
    nats.run_for(10ms);
    BOOST_TEST(hub.core().has_left("north"));
    BOOST_TEST(!hub.core().has_left("nobody"));
    gate.restart();
    gate.connect();
    nats.run_for(100ms);
    BOOST_TEST(!hub.core().has_left("north"));
    gate.restart(); // without a word
    nats.run_for(2s);
    BOOST_TEST(!hub.core().is_live("north"));
    BOOST_TEST(!hub.core().has_left("north"));
}

BOOST_AUTO_TEST_SUITE_END()
