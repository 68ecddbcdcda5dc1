// SPDX-License-Identifier: BSL-1.0
// Sessions of bridges (docs/protocol_security.md, "Sessions of bridges").
#include "federation/bridge.hpp"
#include "federation/sealed/sealed_site.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sealed_sessions {
namespace {

using namespace std::chrono_literals;
using cles::bridging::question_subject;
using cles::bridging::reply_subject;
using cles::bridging::request_subject;
using cles::bridging::test::sealed_site;
using cles::bridging::test::simulated_nats;

constexpr char pool_kind = '\x85';
constexpr char session_kind = '\x88';

struct captured {
    std::string subject;
    std::string message;
};

/// Of a question: whether it is as long as HELLO or WELCOME.
bool begins_session(const std::string& message) {
    return message.front() == pool_kind && message.size() >= cles::core::message_seal::overhead + 80;
}

/// hub is of the pool south, gate of north. Not connected.
struct two_bridges {
    simulated_nats nats{1};
    cles::security::fleet_authority authority = cles::security::test::authority_with({"hub", "gate", "other"});
    sealed_site hub{nats, authority, "south", "hub", 11};
    sealed_site gate{nats, authority, "north", "gate", 12};
    std::vector<captured> seen; ///< what was sent to one bridge: requests, replies and control lines

    two_bridges() {
        hub->names = {"hub", "car1"};
        gate->names = {"gate", "car9"};
        nats.lose = [this](const std::string& subject, const std::string& message) {
            note(subject, message);
            return false;
        };
    }
    void note(const std::string& subject, const std::string& message) {
        if (subject.find(".bridge.") != std::string::npos && !subject.ends_with(".seal")) {
            seen.push_back({subject, message});
        }
    }
    void meet() {
        hub->connect();
        gate->connect();
        nats.run_for(2s);
        BOOST_REQUIRE(know());
    }
    [[nodiscard]] bool know() {
        return hub->core().pools().is_live(gate.id()) && gate->core().pools().is_live(hub.id());
    }
    void check_that_requests_cross() {
        const auto there = hub->ask("north", "PUSH north.car9:echo {\"to\":\"north\"}");
        const auto back = gate->ask("south", "PUSH south.car1:echo {\"to\":\"south\"}");
        nats.run_for(10ms);
        BOOST_TEST(hub->answer(there) == "{\"to\":\"north\"}");
        BOOST_TEST(gate->answer(back) == "{\"to\":\"south\"}");
    }
    [[nodiscard]] std::size_t count(char kind) const {
        return static_cast<std::size_t>(
            std::ranges::count_if(seen, [kind](const captured& each) { return each.message.front() == kind; }));
    }
    [[nodiscard]] std::uint64_t refused() { return gate->core().counted().messages_refused; }
    /// From now on, messages for which the condition holds are lost.
    template <class Condition>
    void lose_if(Condition is_lost) {
        nats.lose = [this, is_lost](const std::string& subject, const std::string& message) {
            note(subject, message);
            return is_lost(subject, message);
        };
    }
};

bool has_words(const std::vector<std::string>& all, std::string_view words) {
    return std::ranges::any_of(all, [words](const auto& each) { return each.find(words) != std::string::npos; });
}

} // namespace

BOOST_AUTO_TEST_SUITE(sealed_sessions)

BOOST_FIXTURE_TEST_CASE(what_is_for_one_bridge_is_sealed_under_a_session, two_bridges) {
    meet();
    check_that_requests_cross();
    const auto bound = hub->ask("north", "BIND car9:speed");
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(bound) == "{}");
    gate->update("car9:speed", 1);
    nats.run_for(10ms);
    BOOST_TEST(hub->updates.size() == 1U);
    BOOST_TEST(!seen.empty());
    BOOST_TEST(count(session_kind) == seen.size());
    BOOST_TEST(refused() + hub->core().counted().messages_refused == 0U);
}

BOOST_FIXTURE_TEST_CASE(with_a_bridge_of_an_earlier_version_all_is_signed, two_bridges) {
    hub->has_sessions = false;
    meet();
    check_that_requests_cross();
    BOOST_TEST(!seen.empty());
    BOOST_TEST(count(pool_kind) == seen.size());
    BOOST_TEST(refused() + hub->core().counted().messages_refused == 0U);
}

// What such a bridge sends when it has been replaced by a newer version is under a session, and back.
BOOST_FIXTURE_TEST_CASE(a_bridge_may_be_upgraded_and_downgraded, two_bridges) {
    hub->has_sessions = false;
    meet();
    for (const bool has_sessions : {true, false, true}) {
        hub->restart();
        hub->has_sessions = has_sessions;
        nats.run_for(100ms);
        hub->connect();
        nats.run_for(3s);
        BOOST_REQUIRE(know());
        seen.clear();
        check_that_requests_cross();
        BOOST_TEST(!seen.empty());
        BOOST_TEST(count(has_sessions ? session_kind : pool_kind) == seen.size());
    }
}

// Whoever administers NATS loses all that could begin one.
BOOST_FIXTURE_TEST_CASE(without_a_session_nothing_is_sent_in_another_way, two_bridges) {
    lose_if([](const std::string& subject, const std::string& message) {
        return subject.ends_with(".seal") && begins_session(message);
    });
    hub->connect();
    gate->connect();
    nats.run_for(2s);
    BOOST_REQUIRE(know());
    seen.clear();
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    const auto back = gate->ask("south", "PUSH car1:echo {\"n\":2}");
    nats.run_for(3s);
    BOOST_TEST(seen.empty());
    BOOST_TEST(hub->answer(id).starts_with(R"({"error":"unavailable")"), hub->answer(id));
    BOOST_TEST(gate->answer(back).starts_with(R"({"error":"unavailable")"), gate->answer(back));
    BOOST_TEST((gate->executed.empty() && hub->executed.empty()));
    nats.lose = nullptr;
    nats.run_for(1s);
    BOOST_TEST(gate->executed.empty()); // nobody waits for it any more
    check_that_requests_cross();
}

BOOST_FIXTURE_TEST_CASE(what_waits_is_limited, two_bridges) {
    lose_if([](const std::string& subject, const std::string& message) {
        return subject.ends_with(".seal") && begins_session(message);
    });
    hub->connect();
    gate->connect();
    nats.run_for(2s);
    BOOST_REQUIRE(know());
    const std::string body = "{\"x\":\"" + std::string(60'000, 'x') + "\"}";
    const auto most = cles::bridging::sealed_channel::most_waiting_for_one / body.size();
    std::vector<std::uint64_t> ids;
    for (std::size_t i = 0; i < 2 * most; ++i) {
        ids.push_back(hub->ask("north", "PUSH car9:echo " + body));
    }
    const auto busy = std::ranges::count_if(
        ids, [this](std::uint64_t id) { return hub->answer(id).starts_with(R"({"error":"busy")"); });
    BOOST_TEST(static_cast<std::size_t>(busy) >= most);
    BOOST_TEST(hub->answer(ids.front()).empty());
}

BOOST_FIXTURE_TEST_CASE(a_message_waits_for_the_session, two_bridges) {
    hub->connect();
    gate->connect();
    bool is_lost = true;
    lose_if([&is_lost, this](const std::string& subject, const std::string& message) {
        return is_lost && subject == question_subject(gate.id()) && begins_session(message);
    });
    nats.run_for(2s);
    BOOST_REQUIRE(know());
    const auto one = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    const auto two = hub->ask("north", "PUSH car9:echo {\"n\":2}");
    nats.run_for(100ms);
    BOOST_TEST((hub->answer(one).empty() && hub->answer(two).empty()));
    is_lost = false;
    nats.run_for(700ms); // of a heartbeat, which repeats HELLO, and less than a message waits
    BOOST_TEST(hub->answer(one) == "{\"n\":1}");
    BOOST_TEST(hub->answer(two) == "{\"n\":2}");
}

// hub states that it has sessions, and signs all the same: it does not learn that gate has them.
BOOST_FIXTURE_TEST_CASE(what_is_signed_does_not_count_of_a_bridge_that_has_sessions, two_bridges) {
    hub->states_sessions_only = true;
    lose_if([this](const std::string& subject, const std::string& message) {
        return subject == question_subject(hub.id()) && begins_session(message);
    });
    hub->connect();
    gate->connect();
    nats.run_for(2s);
    BOOST_REQUIRE(know());
    const auto id = hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(3s);
    BOOST_TEST(count(pool_kind) != 0U);
    BOOST_TEST(count(session_kind) == 0U);
    BOOST_TEST(gate->executed.empty());
    BOOST_TEST(hub->answer(id).starts_with(R"({"error":"unavailable")"), hub->answer(id));
    BOOST_TEST(has_words(gate->logged, "it is signed, and its sender has sessions"));
}

BOOST_FIXTURE_TEST_CASE(nothing_of_a_session_counts_again, two_bridges) {
    meet();
    seen.clear();
    hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(10ms);
    BOOST_REQUIRE(gate->executed["{\"n\":1}"] == 1);
    const auto request =
        std::ranges::find_if(seen, [this](const captured& each) { return each.subject == request_subject(gate.id()); });
    BOOST_REQUIRE((request != seen.end()));
    const auto sent = *request;
    const auto reply = reply_subject(hub.id(), 1);
    const auto repeat = [&] {
        gate->receive(sent.subject, reply, sent.message);
        nats.run_for(10ms);
        BOOST_TEST(gate->executed["{\"n\":1}"] == 1);
    };
    repeat();
    hub->restart();
    repeat();
    hub->connect();
    nats.run_for(3s); // the instance before is lost
    BOOST_REQUIRE(know());
    repeat();
    gate->restart();
    gate->connect();
    nats.run_for(3s);
    BOOST_REQUIRE(know());
    gate->executed["{\"n\":1}"] = 1;
    repeat();
    check_that_requests_cross();
}

BOOST_FIXTURE_TEST_CASE(a_member_that_is_removed_has_no_session_any_more, two_bridges) {
    meet();
    check_that_requests_cross();
    const auto before = gate->executed.size();
    authority.remove("hub");
    BOOST_REQUIRE((gate.fleet.offer(authority.newest().line()) == cles::security::fleet::verdict::adopted));
    hub->ask("north", "PUSH car9:echo {\"n\":1}");
    nats.run_for(100ms);
    BOOST_TEST(gate->executed.size() == before);
    BOOST_TEST(has_words(gate->logged, "its sender is not in the roster"));
}

// gate takes hub for lost, whose session then is not known there any more.
BOOST_FIXTURE_TEST_CASE(a_bridge_that_was_lost_begins_another_session, two_bridges) {
    meet();
    lose_if([this](const std::string& subject, const std::string&) {
        return subject == cles::bridging::heartbeat_subject(hub.id());
    });
    nats.run_for(2s);
    BOOST_REQUIRE(!gate->core().pools().is_live(hub.id()));
    nats.lose = nullptr;
    nats.run_for(2s);
    BOOST_REQUIRE(know());
    check_that_requests_cross();
}

// gate tells hub that it had lost it. So hub ends its sessions with gate, which is live there all the time.
BOOST_FIXTURE_TEST_CASE(who_was_taken_for_lost_signs_nothing, two_bridges) {
    meet();
    lose_if([this](const std::string& subject, const std::string&) {
        return subject == cles::bridging::heartbeat_subject(hub.id());
    });
    nats.run_for(2s);
    BOOST_REQUIRE(!gate->core().pools().is_live(hub.id()));
    seen.clear();
    lose_if([](const std::string&, const std::string&) { return false; });
    for (int i = 0; i < 100 && hub->core().counted().bridges_lost == 0; ++i) {
        nats.run_for(10ms);
    }
    BOOST_REQUIRE(hub->core().counted().bridges_lost == 1U);
    BOOST_REQUIRE(know());
    const auto there = hub->ask("north", "PUSH north.car9:echo {\"n\":1}");
    nats.run_for(100ms);
    BOOST_TEST(hub->answer(there) == "{\"n\":1}");
    const auto back = gate->ask("south", "PUSH south.car1:echo {\"n\":2}");
    nats.run_for(100ms);
    BOOST_TEST(gate->answer(back) == "{\"n\":2}");
    BOOST_TEST(count(pool_kind) == 0U);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace sealed_sessions
