// SPDX-License-Identifier: BSL-1.0
// Bridges of a secured fleet (docs/protocol_security.md, "Through NATS").
#include "federation/bridge.hpp"
#include "federation/heartbeat.hpp"
#include "federation/sealed/sealed_site.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sealed_bridges {
namespace {

using namespace std::chrono_literals;
using cles::bridging::bridge_id;
using cles::bridging::bridge_link;
using cles::bridging::control_subject;
using cles::bridging::heartbeat;
using cles::bridging::heartbeat_subject;
using cles::bridging::message_sender;
using cles::bridging::names_of;
using cles::bridging::names_subject;
using cles::bridging::question_subject;
using cles::bridging::reply_subject;
using cles::bridging::request_subject;
using cles::bridging::text_of;
using cles::bridging::test::sealed_site;
using cles::bridging::test::simulated_nats;
using cles::core::message_seal;

constexpr auto three_heartbeats = 1200ms;
const std::string cancel_first = "PUSH self:cles/cancel/1";
const std::string lost = "PUSH self:cles/lost";

bool has_words(const std::vector<std::string>& all, std::string_view words) {
    return std::ranges::any_of(all, [words](const auto& each) { return each.find(words) != std::string::npos; });
}

/// As in site::binds.
std::vector<std::string> checked(const std::string& member, const std::string& from, const std::string& noun) {
    return {member + " " + from + " " + noun};
}

/// hub is of the pool south; gate and gate2 of north; west of a third pool. Not connected.
struct fleet_of_bridges {
    simulated_nats nats{1};
    cles::security::fleet_authority authority =
        cles::security::test::authority_with({"hub", "gate", "gate2", "west", "operator"});
    sealed_site hub{nats, authority, "south", "hub", 11};
    sealed_site gate{nats, authority, "north", "gate", 12};
    sealed_site gate2{nats, authority, "north", "gate2", 13};
    sealed_site west{nats, authority, "west", "west", 14};

    fleet_of_bridges() {
        hub->names = {"hub", "car1"};
        gate->names = gate2->names = {"gate", "gate2", "car9"};
    }
    static bool know(sealed_site& one, sealed_site& other) {
        return one->core().pools().is_live(other.id()) && other->core().pools().is_live(one.id());
    }
    void check_that_requests_cross() {
        const auto there = hub->ask("north", "PUSH north.car9:echo {\"to\":\"north\"}");
        const auto back = gate->ask("south", "PUSH south.car1:echo {\"to\":\"south\"}");
        nats.run_for(10ms);
        BOOST_TEST(hub->answer(there) == "{\"to\":\"north\"}");
        BOOST_TEST(gate->answer(back) == "{\"to\":\"south\"}");
    }
    /// By the first byte: POOL, ASK, ROSTER or SESSION; and no word of a message can be read.
    void check_that_all_is_sealed() const {
        const auto all = nats.recorded("");
        BOOST_TEST(!all.empty());
        for (const auto& each : all) {
            const auto bytes = each.substr(each.find(' ') + 1);
            BOOST_TEST((bytes.starts_with('\x85') || bytes.starts_with('\x86') || bytes.starts_with('\x87') ||
                        bytes.starts_with('\x88')),
                       each);
        }
        for (const std::string_view words : {"interval_ms", "digest", "\"to\"", "taken=", "PUSH", "ask ", "hello "}) {
            BOOST_TEST(!has_words(all, words), words);
        }
    }
    /// As if a message of that sender had been opened.
    void pass(sealed_site& to, const std::string& subject, const std::string& reply, const std::string& message,
              const message_sender& by) {
        to->core().on_message({subject, reply, message, nats.now(), by});
        nats.run_for(10ms);
    }
};

/// Two pools that know each other.
struct two_pools : fleet_of_bridges {
    two_pools() {
        hub->connect();
        gate->connect();
        nats.run_for(2s);
        BOOST_REQUIRE(know(hub, gate));
    }
    [[nodiscard]] std::uint64_t refused() { return gate->core().counted().messages_refused; }
};

/// The same with a bridge more in each: three pools.
struct three_pools : two_pools {
    three_pools() {
        gate2->connect();
        west->connect();
        nats.run_for(2s);
        BOOST_REQUIRE((know(hub, gate2) && know(gate, gate2) && know(hub, west) && know(gate, west)));
    }
};

} // namespace
} // namespace sealed_bridges

BOOST_AUTO_TEST_SUITE(sealed_bridges)

using namespace sealed_bridges;

// -- they meet -----------------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(bridges_find_each_other_from_a_cold_start, fleet_of_bridges) {
    hub->connect();
    gate->connect();
    nats.run_for(three_heartbeats);
    BOOST_TEST(know(hub, gate));
    nats.run_for(1s);
    BOOST_TEST(hub->core().pool_of("car9", nats.now()) == "north");
    BOOST_TEST(gate->core().pool_of("car1", nats.now()) == "south");
    check_that_requests_cross();
    check_that_all_is_sealed();
    BOOST_TEST(hub->core().counted().messages_refused == 0U);
    BOOST_TEST(gate->core().counted().messages_refused == 0U);
    BOOST_TEST(hub->core().round_trip().has_value());
}

BOOST_FIXTURE_TEST_CASE(they_find_each_other_after_a_restart_of_either, two_pools) {
    for (auto* const restarted : {&gate, &hub, &gate}) {
        const auto before = restarted->id();
        restarted->at.restart(); // without a word
        nats.run_for(100ms);
        restarted->at.connect();
        nats.run_for(three_heartbeats);
        BOOST_TEST(restarted->id().instance != before.instance);
        BOOST_TEST(know(hub, gate));
        nats.run_for(1s);
        check_that_requests_cross();
    }
    check_that_all_is_sealed();
}

BOOST_FIXTURE_TEST_CASE(a_new_connection_replaces_the_old_one, two_pools) {
    const auto before = hub.id();
    hub->disconnect();
    hub->connect();
    nats.run_for(600ms);
    BOOST_TEST(know(hub, gate));
    BOOST_TEST(!gate->core().pools().is_live(before));
    check_that_requests_cross();
}

// Its number in the roster is another one then, and so are its instances.
BOOST_FIXTURE_TEST_CASE(a_member_that_was_added_again_connects_anew, two_pools) {
    const auto before = hub.id();
    authority.remove("hub");
    authority.add(cles::security::test::node("hub"));
    for (auto* const each : {&hub, &gate}) {
        BOOST_REQUIRE((each->fleet.offer(authority.newest().line()) == cles::security::fleet::verdict::adopted));
    }
    hub->disconnect();
    hub->connect();
    nats.run_for(3s);
    BOOST_TEST(hub.id().instance.substr(0, 6) != before.instance.substr(0, 6));
    BOOST_TEST(know(hub, gate));
    BOOST_TEST(!gate->core().pools().is_live(before));
    check_that_requests_cross();
}

BOOST_FIXTURE_TEST_CASE(they_find_each_other_although_messages_are_lost, fleet_of_bridges) {
    nats.impair() = {.longest_delay = 30ms, .loss = 0.2, .repetition = 0.2};
    hub->connect();
    gate->connect();
    nats.run_for(10s);
    nats.impair() = {};
    nats.run_for(2s);
    BOOST_TEST(know(hub, gate));
    check_that_requests_cross();
}

BOOST_FIXTURE_TEST_CASE(repeated_messages_have_no_effect, two_pools) {
    nats.impair().repetition = 1;
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(gate->executed["{\"n\":1}"] == 1);
    BOOST_TEST(hub->answers[id].size() == 1U);
    BOOST_TEST(refused() != 0U);
}

// gate does not learn that hub is alive: hub's answers to its questions are lost.
BOOST_FIXTURE_TEST_CASE(a_request_of_a_sender_that_is_not_proved_to_be_alive_is_busy, fleet_of_bridges) {
    constexpr std::string_view live = "live 0123456789012345678901";
    hub->has_sessions = false; // else it waits for one
    gate->connect();
    nats.lose = [&](const std::string& subject, const std::string& message) {
        return subject == question_subject(gate.id()) && message.size() == message_seal::overhead + live.size();
    };
    hub->connect();
    nats.run_for(three_heartbeats);
    BOOST_REQUIRE(hub->core().is_live("north"));
    BOOST_REQUIRE(!gate->core().is_live("south"));
    const auto early = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(100ms);
    BOOST_TEST(hub->answer(early).starts_with(R"({"error":"busy")"), hub->answer(early));
    BOOST_TEST(hub->answer(early).find(R"("retry_ms":)") != std::string::npos, hub->answer(early));
    BOOST_TEST(gate->executed.empty());
    nats.lose = nullptr;
    nats.run_for(2s);
    BOOST_TEST(gate->executed.empty()); // that one is over
    const auto late = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(late) == "{\"n\":1}");
    BOOST_TEST(gate->executed["{\"n\":1}"] == 1);
}

BOOST_FIXTURE_TEST_CASE(only_requests_are_answered_with_busy, two_pools) {
    const auto before = nats.recorded("").size();
    gate->core().on_unproven({reply_subject(gate.id(), 1), "", "", nats.now()});
    gate->core().on_unproven({heartbeat_subject(hub.id()), "cles.south.bridge.0000010000000001.9", "", nats.now()});
    gate->core().on_unproven({request_subject(gate.id()), "", "", nats.now()});
    gate->core().on_unproven({request_subject(gate2.id()), "cles.south.bridge.0000010000000001.9", "", nats.now()});
    BOOST_TEST(nats.recorded("").size() == before);
}

// -- heartbeats ----------------------------------------------------------------------------------------------------

struct forged_heartbeats : three_pools {
    static heartbeat said_by(const std::string& node) {
        return {.node = node, .names = names_of({node}).digest, .roster = 1};
    }
    /// A heartbeat that west has sealed, for that bridge.
    void say(const bridge_id& of, const heartbeat& said) {
        const auto before = refused();
        const auto bridges = gate->core().pools().bridge_count();
        const auto stated = gate->rosters.size();
        gate->core().on_message({heartbeat_subject(of), "", text_of(said), nats.now(), west.sender()});
        BOOST_TEST(refused() == before + 1);
        BOOST_TEST(gate->core().pools().bridge_count() == bridges);
        BOOST_TEST((know(gate, hub) && know(gate, gate2) && know(gate, west)));
        BOOST_TEST(gate->lost.empty());
        BOOST_TEST(gate->rosters.size() == stated);
    }
};

BOOST_FIXTURE_TEST_CASE(a_heartbeat_is_its_senders_own, forged_heartbeats) {
    say(west.id(), said_by("hub"));                      // under another node's name
    say({"west", hub.id().instance}, said_by("west"));   // with the instance of another member
    say({"south", "0000010000000001"}, said_by("west")); // with a new one of another member
    auto replacing = said_by("west");
    replacing.replaces = hub.id().instance;
    say({"south", west.id().instance}, replacing);
    auto leaving = said_by("west");
    leaving.leaving = true;
    say(hub.id(), leaving);
    leaving.node = "hub";
    say(hub.id(), leaving);
}

BOOST_FIXTURE_TEST_CASE(its_sender_may_replace_itself_and_leave, forged_heartbeats) {
    const auto before = west.id();
    auto said = said_by("west");
    said.replaces = before.instance;
    const auto next = before.instance.substr(0, 6) + "0123456789";
    pass(gate, heartbeat_subject({"west", next}), "", text_of(said), {"west", next});
    BOOST_TEST(!gate->core().pools().is_live(before));
    BOOST_TEST(gate->core().pools().is_live(bridge_id{"west", next}));
    said.leaving = true;
    pass(gate, heartbeat_subject({"west", next}), "", text_of(said), {"west", next});
    BOOST_TEST(!gate->core().pools().is_live(bridge_id{"west", next}));
}

BOOST_FIXTURE_TEST_CASE(the_seal_refuses_the_subjects_of_another_bridge, three_pools) {
    auto leaving = forged_heartbeats::said_by("hub");
    leaving.leaving = true;
    const auto subject = heartbeat_subject(hub.id());
    const auto before = refused();
    nats.publish(subject, "", west->seal(subject, "", text_of(leaving)));
    const auto names = names_subject(hub.id());
    nats.publish(names, "", west->seal(names, "", text_of(names_of({"stolen"}))));
    nats.run_for(10ms);
    BOOST_TEST(refused() == before + 2);
    BOOST_TEST(know(gate, hub));
    BOOST_TEST(gate->core().pool_of("stolen", nats.now()).empty());
    BOOST_TEST(has_words(gate->logged, "it is not of the bridge that its subjects state"));
}

// -- who may not forward -------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(a_member_that_may_not_forward_is_no_bridge, fleet_of_bridges) {
    gate->distrusted = {"hub"};
    hub->connect();
    gate->connect();
    nats.run_for(2s);
    BOOST_TEST(hub->core().is_live("north"));
    BOOST_TEST(!gate->core().is_live("south"));
    BOOST_TEST(gate->core().pool_of("car1", nats.now()).empty());
    BOOST_REQUIRE(gate->logged.size() == 1U);
    BOOST_TEST(gate->logged[0] ==
               "dropped what 'hub' has sent through NATS: it may not forward for this node (permit hub)");
    // Its roster may be the one that permits it.
    BOOST_TEST(has_words(gate->rosters, hub.id().instance + " " + std::to_string(hub.fleet.in_force().version())));
    BOOST_TEST((gate->core().not_permitted() == std::set<std::string, std::less<>>{"hub"}));
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(id) == R"x({"error":"denied","message":"'hub' may not forward for 'gate' (permit hub)"})x");
    BOOST_TEST(gate->executed.empty());
    gate->distrusted.clear();
    nats.run_for(three_heartbeats);
    BOOST_TEST(know(hub, gate));
}

BOOST_FIXTURE_TEST_CASE(a_newer_roster_comes_from_a_member_that_may_not_forward_yet, fleet_of_bridges) {
    gate->distrusted = {"hub"};
    authority.add(cles::security::test::node("new"));
    BOOST_REQUIRE((hub.fleet.offer(authority.newest().line()) == cles::security::fleet::verdict::adopted));
    hub->connect();
    gate->connect();
    nats.run_for(2s);
    BOOST_TEST(gate.fleet.in_force().version() == authority.newest().version());
    check_that_all_is_sealed();
}

BOOST_FIXTURE_TEST_CASE(nothing_that_it_says_or_replies_counts, two_pools) {
    const auto bind = gate->ask("south", "BIND car1:speed");
    nats.run_for(10ms);
    BOOST_REQUIRE(gate->answer(bind) == "{}");
    hub->update("car1:speed", 1);
    nats.run_for(10ms);
    BOOST_REQUIRE(gate->updates.size() == 1U);
    gate->distrusted = {"hub"};
    const auto before = refused();
    hub->update("car1:speed", 2);
    nats.run_for(10ms);
    BOOST_TEST(gate->updates.size() == 1U);
    BOOST_TEST(refused() == before + 1);
    pass(gate, names_subject(hub.id()), "", text_of(names_of({"hub", "car1", "new"})), hub.sender());
    BOOST_TEST(gate->core().pool_of("new", nats.now()).empty());
    BOOST_TEST(refused() == before + 2);
    const auto id = gate->ask("south", "PUSH car1:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub->executed["{\"n\":1}"] == 1);
    BOOST_TEST(gate->answer(id).empty());
    BOOST_TEST(refused() == before + 3);
    BOOST_TEST(has_words(gate->logged, "it may not forward for this node (permit hub)"));
}

// -- replies and control -------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(a_bridge_acknowledges_for_itself_only, three_pools) {
    gate->answer_after = gate2->answer_after = 60s;
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    const auto before = hub->core().counted().messages_refused;
    for (const std::string rest : {"", " {\"forged\":1}"}) {
        pass(hub, reply_subject(hub.id(), 1), "", "taken=" + gate.id().instance + rest, west.sender());
    }
    BOOST_TEST(hub->answer(id).empty());
    BOOST_TEST(hub->core().counted().messages_refused == before + 2);
    BOOST_TEST(has_words(hub->logged, "it acknowledges a request for another bridge"));
    BOOST_TEST(has_words(hub->logged, "dropped a message of NATS from west on "));
    pass(hub, reply_subject(hub.id(), 1), "", "taken=" + gate.id().instance + " {\"n\":2}", gate.sender());
    BOOST_TEST(hub->answer(id) == "{\"n\":2}");
}

BOOST_FIXTURE_TEST_CASE(a_control_line_is_its_senders_own, three_pools) {
    gate2->restart(); // so that gate takes all
    nats.run_for(2s);
    gate->answer_after = 60s;
    hub->ask("north", "PUSH car9:echo {\"n\":1}");
    hub->ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    BOOST_REQUIRE(gate->bound.contains("car9:speed"));
    const auto to = control_subject(gate.id());
    const auto own = control_subject(hub.id());
    const auto by_number = reply_subject(hub.id(), 1);
    const auto before = refused();
    pass(gate, to, by_number, cancel_first, west.sender());
    pass(gate, to, own, "BIND car9:speed lease=0", west.sender());
    pass(gate, to, own, lost, west.sender());
    BOOST_TEST(refused() == before + 3);
    BOOST_TEST(gate->cancelled.empty());
    BOOST_TEST(gate->bound.contains("car9:speed"));
    pass(gate, to, by_number, cancel_first, hub.sender());
    BOOST_TEST(gate->cancelled.size() == 1U);
    pass(gate, to, own, "BIND car9:speed lease=0", hub.sender());
    BOOST_TEST(!gate->bound.contains("car9:speed"));
    hub->ask("north", "PUSH car9:echo {\"n\":2}");
    nats.run_for(10ms);
    pass(gate, to, own, lost, hub.sender());
    BOOST_TEST(gate->cancelled.size() == 2U);
    BOOST_TEST(refused() == before + 3);
}

BOOST_FIXTURE_TEST_CASE(the_control_lines_of_bridges_have_their_effect, two_pools) {
    gate->answer_after = 60s;
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    hub->ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    hub->cancel("north", id);
    hub->ask("north", "BIND car9:speed lease=0");
    nats.run_for(10ms);
    BOOST_TEST(gate->cancelled == std::vector<std::string>{"{\"n\":1}"}, boost::test_tools::per_element());
    BOOST_TEST(!gate->bound.contains("car9:speed"));
    BOOST_TEST(refused() == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_bind_is_passed_on_within_the_pool, three_pools) {
    std::size_t passed_on = 0;
    for (int i = 0; i < 20; ++i) {
        const auto path = "n" + std::to_string(i) + "/fast";
        const auto noun = "car9:" + path;
        gate->binds.clear();
        gate2->binds.clear();
        const bool is_operators = i % 2 != 0;
        const auto id = hub->ask("north", "BIND " + noun + " keep=3" + (is_operators ? " from=operator" : ""));
        nats.run_for(10ms);
        BOOST_TEST(hub->answer(id) == "{}");
        BOOST_TEST(gate->bound.contains(noun) != gate2->bound.contains(noun), noun);
        auto& taker = gate->bound.contains(noun) ? gate : gate2;
        auto& other = gate->bound.contains(noun) ? gate2 : gate;
        const std::string stated = is_operators ? "operator" : "-";
        if (other->binds.empty()) { // it was sent to the one that publishes the noun
            BOOST_TEST(taker->binds == checked("hub", stated, noun), boost::test_tools::per_element());
            continue;
        }
        ++passed_on;
        BOOST_TEST(other->binds == checked("hub", stated, noun), boost::test_tools::per_element());
        const std::string for_whom = is_operators ? "operator" : "hub";
        BOOST_TEST(taker->binds == checked(other.fleet.name(), for_whom, noun), boost::test_tools::per_element());
        taker->update(noun, 7);
        nats.run_for(10ms);
        BOOST_TEST(has_words(hub->updates, "UPDATE " + noun + " seq=7"));
    }
    BOOST_TEST(passed_on > 3U);
    BOOST_TEST(passed_on < 17U);
    BOOST_TEST(refused() + gate2->core().counted().messages_refused == 0U);
}

BOOST_FIXTURE_TEST_CASE(one_without_the_right_is_not_passed_on, three_pools) {
    for (int i = 0; i < 8; ++i) {
        const auto id = hub->ask("north", "BIND car9:secret/" + std::to_string(i));
        nats.run_for(10ms);
        BOOST_TEST(hub->answer(id) == R"({"error":"denied","message":"secret"})");
    }
    BOOST_TEST(gate->binds.size() + gate2->binds.size() == 8U);
    BOOST_TEST(gate->bound.empty());
    BOOST_TEST(gate2->bound.empty());
}

BOOST_FIXTURE_TEST_CASE(a_bridge_of_another_pool_passes_nothing_on, three_pools) {
    const auto to = control_subject(gate.id());
    const auto before = refused();
    pass(gate, to, reply_subject(hub.id(), 99), "BIND car9:speed from=hub", west.sender());
    BOOST_TEST(refused() == before + 1);
    BOOST_TEST(gate->binds.empty());
    BOOST_TEST(gate->bound.empty());
    pass(gate, to, reply_subject(hub.id(), 99), "BIND car9:speed from=hub", gate2.sender());
    BOOST_TEST(gate->bound.contains("car9:speed"));
    BOOST_TEST(refused() == before + 1);
}

// -- the rights change ---------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(the_last_bridge_without_the_right_takes_the_pool_with_it, two_pools) {
    gate->answer_after = 60s;
    hub->ask("north", "PUSH car9:echo {\"n\":1}");
    hub->ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    gate->distrusted = {"hub"};
    const auto changed = gate->pools_changed;
    gate->change_security();
    BOOST_TEST(!gate->core().is_live("south"));
    BOOST_TEST(gate->lost == std::vector<std::string>{"pool south"}, boost::test_tools::per_element());
    BOOST_TEST(gate->pools_changed > changed);
    nats.run_for(0ms);
    BOOST_TEST(gate->cancelled == std::vector<std::string>{"{\"n\":1}"}, boost::test_tools::per_element());
    BOOST_TEST(!gate->bound.contains("car9:speed"));
    gate->change_security();
    BOOST_TEST(gate->lost.size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(what_a_bridge_took_that_lost_the_right_is_unavailable, three_pools) {
    gate->answer_after = gate2->answer_after = 60s;
    std::vector<std::uint64_t> ids;
    ids.reserve(20);
    for (int i = 0; i < 20; ++i) {
        ids.push_back(hub->ask("north", "PUSH car9:echo {\"n\":" + std::to_string(i) + "}"));
        hub->ask("north", "BIND car9:n" + std::to_string(i));
    }
    nats.run_for(100ms);
    const auto of_gate = gate->executed.size();
    BOOST_REQUIRE((of_gate > 0U && of_gate < ids.size()));
    hub->distrusted = {"gate"};
    hub->change_security();
    const auto failed = std::ranges::count_if(ids, [&](auto id) {
        return hub->answer(id) ==
               R"({"error":"unavailable","message":"the bridge of the pool 'north' may not forward for this node any more"})";
    });
    BOOST_TEST(static_cast<std::size_t>(failed) == of_gate);
    BOOST_TEST(hub->core().pools().is_live(gate2.id()));
    BOOST_TEST(!hub->lost.empty());
    BOOST_TEST(std::ranges::all_of(hub->lost, [](const auto& what) { return what.starts_with("binding car9:n"); }));
    nats.run_for(2s);
    BOOST_TEST(!hub->core().pools().is_live(gate.id()));
}

BOOST_FIXTURE_TEST_CASE(a_bridge_that_has_the_right_again_learns_that_it_was_lost, two_pools) {
    hub->ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    gate->distrusted = {"hub"};
    gate->change_security();
    nats.run_for(1s);
    BOOST_TEST(!gate->bound.contains("car9:speed"));
    BOOST_TEST(hub->lost.empty());
    gate->distrusted.clear();
    gate->change_security();
    nats.run_for(three_heartbeats);
    BOOST_TEST(know(hub, gate));
    BOOST_TEST(hub->lost.size() == 1U); // its node binds again
}

// -- requests ------------------------------------------------------------------------------------------------------

BOOST_FIXTURE_TEST_CASE(a_cancellation_goes_to_the_link_of_the_member, three_pools) {
    hub->answer_after = 60s;
    gate->ask("south", "PUSH car1:echo {\"by\":\"gate\"}");
    const auto id = gate2->ask("south", "PUSH car1:echo {\"by\":\"gate2\"}");
    nats.run_for(10ms);
    BOOST_REQUIRE(hub->executed.size() == 2U);
    gate2->cancel("south", id); // on another link, the node would not find it
    nats.run_for(10ms);
    BOOST_TEST(hub->cancelled == std::vector<std::string>{"{\"by\":\"gate2\"}"}, boost::test_tools::per_element());
    gate->restart();
    nats.run_for(2s);
    BOOST_REQUIRE(hub->cancelled.size() == 2U);
    BOOST_TEST(hub->cancelled.back() == "{\"by\":\"gate\"}");
}

BOOST_FIXTURE_TEST_CASE(a_link_that_ends_concerns_the_requests_of_its_member, three_pools) {
    hub->answer_after = 1s;
    const auto one = gate->ask("south", "PUSH car1:echo {\"by\":\"gate\"}");
    const auto other = gate2->ask("south", "PUSH car1:echo {\"by\":\"gate2\"}");
    nats.run_for(10ms);
    hub->core().on_closed({.what = bridge_link::role::from_pool, .pool = "north", .member = "gate"});
    nats.run_for(10ms);
    BOOST_TEST(gate->answer(one) == R"({"error":"unavailable","message":"hub has closed the link"})");
    BOOST_TEST(gate2->answer(other).empty());
    nats.run_for(1s);
    BOOST_TEST(gate2->answer(other) == "{\"by\":\"gate2\"}");
}

BOOST_FIXTURE_TEST_CASE(programs_that_use_nats_are_not_served, three_pools) {
    const auto subject = request_subject(gate.id());
    const auto before = refused();
    const auto line = [](int n) { return "PUSH car9:echo {\"n\":" + std::to_string(n) + "}"; };
    nats.publish(subject, "_INBOX.1", line(1));
    nats.publish(subject, "_INBOX.2", west->seal(subject, "_INBOX.2", line(2)));
    nats.publish(subject, "", west->seal(subject, "", line(3)));
    // Nor is a request that states the subject for replies of another member's bridge.
    const auto of_hub = reply_subject(hub.id(), 77);
    nats.publish(subject, of_hub, west->seal(subject, of_hub, line(4)));
    // Nor one for any bridge of the pool, which could run at each.
    const std::string of_pool = "cles.north.push.car9.echo";
    const auto of_west = reply_subject(west.id(), 78);
    gate->receive(of_pool, of_west, west->seal(of_pool, of_west, "{\"n\":5}"));
    nats.run_for(3s);
    BOOST_TEST(gate->executed.empty());
    BOOST_TEST(refused() == before + 5);
    BOOST_TEST(nats.recorded("_INBOX.").size() == 0U);
}

// The server delivers a request to another bridge, too.
BOOST_FIXTURE_TEST_CASE(a_request_runs_at_the_bridge_that_it_is_for, three_pools) {
    std::vector<std::pair<std::string, std::string>> seen;
    nats.lose = [&seen](const std::string& subject, const std::string& message) {
        if (subject.ends_with(".request")) {
            seen.emplace_back(subject, message);
        }
        return false;
    };
    for (int i = 0; i < 4; ++i) {
        hub->ask("north", "PUSH car9:echo {\"n\":" + std::to_string(i) + "}");
        nats.run_for(10ms);
    }
    BOOST_REQUIRE(seen.size() == 4U);
    BOOST_TEST((gate->executed.size() == 2U && gate2->executed.size() == 2U));
    const auto replies = nats.recorded("cles.south.bridge.").size();
    const auto before = refused() + gate2->core().counted().messages_refused;
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const auto reply = reply_subject(hub.id(), i + 1);
        gate->receive(seen[i].first, reply, seen[i].second);
        gate2->receive(seen[i].first, reply, seen[i].second);
    }
    nats.run_for(10ms);
    for (const auto* const at : {&gate, &gate2}) {
        for (const auto& [body, times] : at->at.executed) {
            BOOST_TEST(times == 1, body);
        }
    }
    BOOST_TEST((gate->executed.size() == 2U && gate2->executed.size() == 2U));
    BOOST_TEST(nats.recorded("cles.south.bridge.").size() == replies); // no answer, either
    BOOST_TEST(refused() + gate2->core().counted().messages_refused == before + 8);
}

// What was held back by the server until the bridge that has sent it was lost.
BOOST_FIXTURE_TEST_CASE(a_request_of_a_bridge_that_is_not_live_has_no_effect, fleet_of_bridges) {
    gate->connect();
    hub->connect();
    nats.lose = [&](const std::string& subject, const std::string&) { return subject == heartbeat_subject(hub.id()); };
    nats.run_for(three_heartbeats);
    BOOST_REQUIRE(hub->core().is_live("north"));
    BOOST_REQUIRE(!gate->core().is_live("south"));
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(id).starts_with(R"({"error":"busy")"), hub->answer(id));
    hub->update("car1:speed", 1);
    nats.run_for(2s);
    BOOST_TEST(gate->executed.empty());
    nats.lose = nullptr;
    nats.run_for(2s);
    BOOST_TEST(know(hub, gate));
    check_that_requests_cross();
    BOOST_TEST(!gate->executed.contains("{\"n\":1}"));
}

BOOST_FIXTURE_TEST_CASE(a_request_that_still_reaches_a_bridge_that_is_to_end_may_be_repeated, two_pools) {
    nats.lose = [&](const std::string& subject, const std::string&) { return subject == heartbeat_subject(gate.id()); };
    gate->core().leave(nats.now());
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(id).starts_with(R"({"error":"busy","message":"gate is shutting down")"), hub->answer(id));
    BOOST_TEST(gate->executed.empty());
}

BOOST_FIXTURE_TEST_CASE(what_was_sent_to_a_bridge_that_is_lost_is_unavailable, three_pools) {
    gate->restart(); // without a word
    std::vector<std::uint64_t> ids;
    for (int i = 0; i < 6; ++i) {
        ids.push_back(hub->ask("north", "PUSH car9:echo {\"n\":" + std::to_string(i) + "}"));
    }
    const auto failed = [&] {
        return std::ranges::count_if(ids,
                                     [&](auto id) { return hub->answer(id).starts_with(R"({"error":"unavailable")"); });
    };
    nats.run_for(900ms);
    BOOST_TEST(failed() == 0);
    nats.run_for(700ms); // 3.5 intervals after its last heartbeat, before an acknowledgement would be missed
    const auto of_gate2 = gate2->executed.size();
    BOOST_TEST((of_gate2 > 0U && of_gate2 < ids.size()));
    BOOST_TEST(static_cast<std::size_t>(failed()) == ids.size() - of_gate2);
}

BOOST_FIXTURE_TEST_CASE(a_bridge_that_is_to_end_gets_no_more_requests, three_pools) {
    gate->answer_after = 100ms;
    std::vector<std::uint64_t> before{hub->ask("north", "PUSH car9:echo {\"n\":1}"),
                                      hub->ask("north", "PUSH car9:echo {\"n\":2}")};
    nats.run_for(10ms);
    BOOST_REQUIRE(gate->executed.size() == 1U);
    gate->core().leave(nats.now());
    nats.run_for(10ms);
    for (int i = 10; i < 16; ++i) {
        hub->ask("north", "PUSH car9:echo {\"n\":" + std::to_string(i) + "}");
    }
    nats.run_for(10ms);
    BOOST_TEST(gate->executed.size() == 1U);
    BOOST_TEST(gate2->executed.size() == 7U);
    nats.run_for(100ms);
    for (const auto id : before) {
        BOOST_TEST(hub->answer(id).starts_with("{\"n\":"), hub->answer(id));
    }
    BOOST_TEST(hub->core().pools().is_live(gate.id()));
    for (int i = 0; i < 8; ++i) { // nor bindings
        hub->ask("north", "BIND car9:n" + std::to_string(i));
    }
    nats.run_for(10ms);
    BOOST_TEST(gate->bound.empty());
    BOOST_TEST(gate2->bound.size() == 8U);
    gate->core().say_left(nats.now());
    nats.run_for(10ms);
    BOOST_TEST(!hub->core().pools().is_live(gate.id()));
}

BOOST_AUTO_TEST_SUITE_END()
