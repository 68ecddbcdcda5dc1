// SPDX-License-Identifier: BSL-1.0
#include "security/child_process.hpp"
#include "security/datagrams/datagram_sessions.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace datagram_sessions {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;
using cles::time_point;

datagram_path at(int host, std::uint16_t port = 25370) {
    return datagram_path::v4(0x0a000000U + static_cast<std::uint32_t>(host), port);
}

// Two cars; the second one can be started again.
struct two_cars {
    test_fleet fleet{3};
    sealed_network network{7};
    datagram_limits limits{};
    std::optional<sealed_node> car1;
    std::optional<sealed_node> car2;

    two_cars() {
        car1.emplace(network, fleet, 1, at(1), 0x11111111, limits);
        car2.emplace(network, fleet, 2, at(2), 0x22222222, limits);
    }
    void restart(std::optional<sealed_node>& car, std::uint32_t epoch) {
        const auto number = static_cast<int>(car->number);
        const auto where = car->at;
        car.emplace(network, fleet, number, where, epoch, limits);
    }
    void adopt_roster() {
        for (auto* const car : {&*car1, &*car2}) {
            static_cast<void>(car->fleet.offer(fleet.authority.newest().line()));
        }
    }
    void establish() {
        car1->send(*car2, "first");
        network.run(300ms); // until car1 has sent an empty line too, and has an answer
        BOOST_REQUIRE(car2->count("first") == 1);
        network.sent.clear();
    }
    // The last datagram of this kind that a node has sent.
    [[nodiscard]] bytes last(datagram_kind kind, const sealed_node& by) const {
        const auto found = std::find_if(network.sent.rbegin(), network.sent.rend(), [&](const auto& d) {
            return d.from == by.at && d.content.front() == static_cast<std::uint8_t>(kind);
        });
        BOOST_REQUIRE(found != network.sent.rend());
        return found->content;
    }
};

using strings = std::vector<std::string>;

} // namespace

BOOST_FIXTURE_TEST_SUITE(datagram_sessions, two_cars)

// -- the handshake -------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_line_waits_for_the_session_and_is_answered_in_it) {
    car2->on_opened = [&](const auto&) { car2->send(*car1, "id=1 {}"); };
    BOOST_TEST(car1->send(*car2, "PULL car2:speed id=1"));
    BOOST_TEST(car1->sessions.waiting() == 20U);
    network.run(10ms);
    BOOST_TEST(car2->lines() == strings{"PULL car2:speed id=1"}, boost::test_tools::per_element());
    BOOST_TEST(car1->lines() == strings{"id=1 {}"}, boost::test_tools::per_element());
    BOOST_TEST((car2->opened_log[0].from == car1->source()));
    BOOST_TEST(car2->opened_log[0].epoch == 0x11111111U);
    BOOST_TEST(car1->sessions.waiting() == 0U);
    BOOST_TEST(network.sent.size() == 4U); // HELLO, WELCOME, and two DATA
    network.run(10s);
    BOOST_TEST(network.sent.size() == 4U);
}

BOOST_AUTO_TEST_CASE(each_end_learns_what_the_other_states) {
    for (int i = 0; i < 5; ++i) {
        static_cast<void>(car1->group.seal("UPDATE car1:speed"));
    }
    car1->contact(*car2);
    network.run(10ms);
    BOOST_REQUIRE(car1->established_log.size() == 1);
    BOOST_REQUIRE(car2->established_log.size() == 1);
    const auto& of1 = car2->established_log[0];
    const auto& of2 = car1->established_log[0];
    BOOST_TEST((of1.with == car1->source()));
    BOOST_TEST(of1.stated.epoch == 0x11111111U);
    BOOST_TEST(of1.stated.roster == fleet.authority.newest().version());
    BOOST_TEST(of1.stated.salt == car1->group.salt());
    BOOST_TEST(of1.stated.counter == 5U);
    BOOST_TEST(!of1.restarted);
    BOOST_TEST((of2.with == car2->source()));
    BOOST_TEST(of2.stated.epoch == 0x22222222U);
    BOOST_TEST(of2.stated.salt == car2->group.salt());
}

BOOST_AUTO_TEST_CASE(without_a_line_the_initiator_sends_an_empty_one_which_is_answered) {
    car1->contact(*car2);
    network.run(10s);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
    BOOST_TEST(network.count(datagram_kind::welcome) == 1U);
    BOOST_TEST(network.count(datagram_kind::data) == 2U); // not answered again
    BOOST_TEST(car1->opened_log.empty());
    BOOST_TEST(car2->opened_log.empty());
}

BOOST_AUTO_TEST_CASE(the_longest_line_passes_and_a_longer_one_is_refused) {
    const std::string longest(1200, 'x');
    BOOST_TEST(car1->send(*car2, longest));
    network.run(10ms);
    BOOST_TEST(car2->count(longest) == 1U);
    BOOST_TEST(car1->send(*car2, longest));
    BOOST_TEST(!car1->send(*car2, longest + "x"));
    network.run(10ms);
    BOOST_TEST(car2->count(longest) == 2U);
    BOOST_TEST(std::ranges::max(network.sent, {}, [](const auto& d) { return d.content.size(); }).content.size() ==
               1236U);
}

BOOST_AUTO_TEST_CASE(hello_is_sent_three_times_and_then_given_up) {
    network.drop = [](const auto&) { return true; };
    const auto start = network.now;
    BOOST_TEST(car1->send(*car2, "line"));
    network.run_until(start + 199ms);
    BOOST_TEST(network.sent.size() == 1U);
    network.run_until(start + 201ms);
    BOOST_TEST(network.sent.size() == 3U); // with its MAC, and without
    network.run_until(start + 599ms);
    BOOST_TEST(network.sent.size() == 3U);
    network.run_until(start + 601ms);
    BOOST_TEST(network.sent.size() == 5U);
    BOOST_TEST(network.sent[0].content.size() == 116U);
    BOOST_TEST(network.sent[0].content == network.sent[1].content);
    BOOST_TEST(network.sent[0].content == network.sent[3].content);
    const bytes without(network.sent[0].content.begin(), network.sent[0].content.begin() + 100);
    BOOST_TEST(network.sent[2].content == without);
    BOOST_TEST(network.sent[4].content == without);
    network.run_until(start + 1399ms);
    BOOST_TEST(car1->gave_up_log.empty());
    network.run_until(start + 1401ms);
    BOOST_REQUIRE(car1->gave_up_log.size() == 1);
    BOOST_TEST((car1->gave_up_log[0] == car2->source()));
    BOOST_TEST(car1->sessions.waiting() == 0U);
    BOOST_TEST(car1->sessions.sources() == 0U);
    BOOST_TEST(!car1->sessions.next_deadline());
    network.run(1min);
    BOOST_TEST(network.sent.size() == 5U);
}

BOOST_AUTO_TEST_CASE(a_node_that_ignores_macs_is_reached_by_the_second_copy) {
    network.drop = [](const auto& d) { return d.content.size() == 116; }; // as its reader does
    car1->send(*car2, "line");
    network.run(199ms);
    BOOST_TEST(car2->count("line") == 0U);
    network.run(10ms);
    BOOST_TEST(car2->count("line") == 1U);
}

BOOST_AUTO_TEST_CASE(hello_without_a_mac_is_answered_in_the_same_way) {
    network.drop = [](const auto& d) { return d.content[0] == 0x81; };
    car1->contact(*car2);
    auto hello = last(datagram_kind::hello, *car1);
    const auto marked = hello;
    hello.resize(100);
    car2->receive(car1->at, hello);
    car2->receive(car1->at, marked);
    BOOST_TEST(network.count(datagram_kind::welcome) == 2U);
    BOOST_TEST(network.sent.back().content == network.sent[network.sent.size() - 2].content);
    network.run(10ms);
    BOOST_TEST(car1->established_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(the_same_hello_has_the_same_welcome) {
    network.drop = [](const auto& d) { return d.content[0] == 0x82; };
    car1->contact(*car2);
    network.run(1s);
    std::vector<bytes> welcomes;
    for (const auto& d : network.sent) {
        if (d.content[0] == 0x82) {
            welcomes.push_back(d.content);
        }
    }
    BOOST_REQUIRE(welcomes.size() == 5);
    BOOST_TEST((std::ranges::adjacent_find(welcomes, std::not_equal_to{}) == welcomes.end()));
    BOOST_TEST(car2->sessions.half_open() == 1U);
}

BOOST_AUTO_TEST_CASE(a_lost_message_of_the_handshake_is_repeated) {
    for (const int kind : {0x81, 0x82, 0x83}) {
        two_cars fresh;
        bool dropped = false;
        fresh.network.drop = [&](const auto& d) { return d.content[0] == kind && !std::exchange(dropped, true); };
        fresh.car1->contact(*fresh.car2);
        fresh.network.run(400ms);
        BOOST_TEST(dropped);
        BOOST_TEST(fresh.car1->established_log.size() == 1U);
        BOOST_TEST(fresh.car2->established_log.size() == 1U);
        fresh.network.run(10s);
        BOOST_TEST(fresh.car1->gave_up_log.empty());
        BOOST_TEST(fresh.car2->sessions.half_open() == 0U);
    }
}

BOOST_AUTO_TEST_CASE(a_session_in_which_no_data_arrives_is_given_up) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->send(*car2, "line");
    network.run(10s);
    BOOST_TEST(network.count(datagram_kind::data) == 3U);
    BOOST_TEST(car1->gave_up_log.size() == 1U);
    BOOST_TEST(car1->sessions.sources() == 0U);
    network.drop = nullptr;
    car1->send(*car2, "again");
    network.run(10ms);
    BOOST_TEST(car2->count("again") == 1U);
}

BOOST_AUTO_TEST_CASE(the_responder_uses_nothing_before_the_first_data) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->contact(*car2);
    network.run(100ms);
    BOOST_TEST(car1->established_log.size() == 1U);
    BOOST_TEST(car2->established_log.empty());
    BOOST_TEST(car2->sessions.sources() == 0U);
    BOOST_TEST(car2->sessions.half_open() == 1U);
    car2->send(*car1, "line"); // has to wait for a session of its own
    BOOST_TEST(car2->sessions.waiting() == 4U);
}

BOOST_AUTO_TEST_CASE(simultaneous_hellos_connect_both_ends) {
    for (const bool lines : {true, false}) {
        two_cars fresh;
        if (lines) {
            fresh.car1->send(*fresh.car2, "from 1");
            fresh.car2->send(*fresh.car1, "from 2");
        } else {
            fresh.car1->contact(*fresh.car2);
            fresh.car2->contact(*fresh.car1);
        }
        fresh.network.run(10s);
        for (int i = 0; i < 5; ++i) {
            fresh.car1->send(*fresh.car2, "more from 1");
            fresh.car2->send(*fresh.car1, "more from 2");
            fresh.network.run(10ms);
        }
        BOOST_TEST(fresh.car2->count("from 1") == (lines ? 1U : 0U));
        BOOST_TEST(fresh.car1->count("from 2") == (lines ? 1U : 0U));
        BOOST_TEST(fresh.car2->count("more from 1") == 5U);
        BOOST_TEST(fresh.car1->count("more from 2") == 5U);
        BOOST_TEST(fresh.car1->gave_up_log.empty());
        BOOST_TEST(fresh.car2->gave_up_log.empty());
        BOOST_TEST(fresh.car1->sessions.half_open() == 0U);
        BOOST_TEST(fresh.car2->sessions.half_open() == 0U);
    }
}

BOOST_AUTO_TEST_CASE(lines_that_wait_go_with_the_session_that_the_other_end_began) {
    network.drop = [&](const auto& d) { return d.content[0] == 0x81 && d.from == car2->at; };
    car2->send(*car1, "waiting");
    car1->contact(*car2);
    network.run(100ms);
    BOOST_TEST(car1->count("waiting") == 1U);
    network.run(10s);
    BOOST_TEST(car2->gave_up_log.empty());
    BOOST_TEST(network.count(datagram_kind::hello) == 2U); // not again
}

BOOST_AUTO_TEST_CASE(what_waits_is_limited) {
    network.drop = [](const auto&) { return true; };
    for (int i = 0; i < 16; ++i) {
        BOOST_TEST(car1->send(*car2, "line"));
    }
    BOOST_TEST(!car1->send(*car2, "line"));
    limits.waiting_bytes = 2000;
    limits.waiting_bytes_in_all = 2500;
    restart(car1, 0x33333333);
    BOOST_TEST(car1->send(*car2, std::string(1200, 'x')));
    BOOST_TEST(!car1->send(*car2, std::string(801, 'x')));
    BOOST_TEST(car1->send(*car2, std::string(800, 'x')));
    BOOST_TEST(!car1->sessions.send({.path = at(3), .member = 3}, std::string(501, 'x'), network.now));
    BOOST_TEST(car1->sessions.send({.path = at(3), .member = 3}, std::string(500, 'x'), network.now));
    BOOST_TEST(car1->sessions.waiting() == 2500U);
    car1->sessions.forget(2);
    BOOST_TEST(car1->sessions.waiting() == 500U);
}

// -- who takes part ------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_hello_of_somebody_else_is_not_answered) {
    test_fleet others{9};
    sealed_node stranger{network, others, 9, at(9), 1};
    car1->contact(*car2);
    auto hello = last(datagram_kind::hello, *car1);
    network.run(10ms);
    network.sent.clear();
    stranger.contact(*car2);
    auto foreign = last(datagram_kind::hello, stranger);
    car2->receive(stranger.at, foreign); // number 9 is not a member
    foreign[3] = 1;
    car2->receive(stranger.at, foreign); // the head is part of the handshake
    hello[3] = 3;
    car2->receive(car1->at, hello); // car3's number, car1's key
    hello[3] = 0;
    car2->receive(car1->at, hello);
    using enum hello_refusal;
    BOOST_TEST((car2->refused_log == std::vector{not_member, unproven, unproven, not_member}));
    network.run(2s);
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    BOOST_TEST(car2->sessions.half_open() == 0U);
}

BOOST_AUTO_TEST_CASE(a_hello_of_another_fleet_is_not_answered) {
    test_fleet others{2};
    others.authority = fleet_authority::found(key_from(201));
    others.add(1);
    others.add(2);
    sealed_node twin{network, others, 1, at(4), 1};
    twin.contact(*car2);
    network.run(2s);
    BOOST_TEST(network.count(datagram_kind::hello) == 5U); // two of them without a MAC
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
}

BOOST_AUTO_TEST_CASE(a_hello_for_another_member_is_not_answered) {
    car1->sessions.contact({.path = car2->at, .member = 3}, network.now);
    network.run(2s);
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    BOOST_TEST(car1->gave_up_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_hello_of_a_member_that_is_not_known_yet_is_not_answered) {
    fleet.add(4);
    sealed_node car4{network, fleet, 4, at(4), 4};
    car4.contact(*car1);
    network.run(2s);
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    adopt_roster();
    car4.contact(*car1);
    network.run(100ms);
    BOOST_TEST(car1->established_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(no_line_is_sent_to_who_is_not_a_member) {
    BOOST_TEST(!car1->sessions.send({.path = at(9), .member = 9}, "line", network.now));
    BOOST_TEST(!car1->sessions.contact({.path = at(9), .member = 9}, network.now));
    BOOST_TEST(!car1->sessions.contact({.path = at(9), .member = 0}, network.now));
    BOOST_TEST(network.sent.empty());
    BOOST_TEST(car1->sessions.sources() == 0U);
}

BOOST_AUTO_TEST_CASE(a_welcome_from_elsewhere_or_by_another_member_is_ignored) {
    network.drop = [](const auto& d) { return d.content[0] == 0x82; };
    car1->contact(*car2);
    network.run(10ms);
    auto welcome = last(datagram_kind::welcome, *car2);
    car1->receive(at(2, 4000), welcome);
    car1->receive(datagram_path::v4(car2->at.v4_address(), 25370, 1), welcome); // on another socket
    welcome[3] = 3;
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.empty());
    welcome[3] = 2;
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.size() == 1U);
    car1->receive(car2->at, welcome); // once
    BOOST_TEST(car1->established_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(no_bit_of_a_handshake_can_be_changed) {
    limits.hellos_per_second = 1'000'000;
    restart(car1, 0x11111112);
    restart(car2, 0x22222223);
    car1->contact(*car2);
    const auto hello = last(datagram_kind::hello, *car1);
    const auto changed_bit = [&](const bytes& of, std::size_t bit) {
        auto changed = of;
        changed[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        return changed;
    };
    network.drop = [](const auto& d) { return d.content[0] == 0x82; };
    for (std::size_t bit = 0; bit < hello.size() * 8; ++bit) {
        car2->receive(car1->at, changed_bit(hello, bit));
    }
    const bytes without_mac(hello.begin(), hello.begin() + 100);
    for (std::size_t bit = 0; bit < without_mac.size() * 8; ++bit) {
        car2->receive(car1->at, changed_bit(without_mac, bit));
        network.now += 500ms; // for the limit
    }
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    car2->receive(car1->at, hello);
    BOOST_REQUIRE(network.count(datagram_kind::welcome) == 1U);
    const auto welcome = last(datagram_kind::welcome, *car2);
    for (std::size_t bit = 0; bit < welcome.size() * 8; ++bit) {
        car1->receive(car2->at, changed_bit(welcome, bit));
    }
    BOOST_TEST(car1->established_log.empty());
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(two_services_with_the_same_key_have_separate_sessions) {
    sealed_node second{network, fleet, 1, at(1, 4000), 0x11111112};
    second.contact(*car1);
    car1->send(*car2, "from the first");
    second.send(*car2, "from the second");
    network.run(100ms);
    second.send(*car1, "to myself");
    car1->send(second, "back");
    network.run(100ms);
    BOOST_TEST(car2->lines() == (strings{"from the first", "from the second"}), boost::test_tools::per_element());
    BOOST_TEST(car2->opened_log[0].epoch == 0x11111111U);
    BOOST_TEST(car2->opened_log[1].epoch == 0x11111112U);
    BOOST_TEST(car1->count("to myself") == 1U);
    BOOST_TEST(second.count("back") == 1U);
    BOOST_TEST(car2->established_log.size() == 2U);
    BOOST_TEST(!car2->established_log[1].restarted);
}

BOOST_AUTO_TEST_CASE(a_hello_that_is_sent_back_makes_no_session_with_oneself) {
    car1->contact(*car2);
    const auto hello = last(datagram_kind::hello, *car1);
    network.drop = [](const auto&) { return true; };
    car1->receive(car2->at, hello);
    BOOST_TEST(car1->sessions.half_open() == 0U);
}

// -- replays -------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(no_replay_is_accepted_across_restarts_of_either_end) {
    std::uint32_t epoch = 0x40000000;
    std::vector<sealed_network::datagram> recorded;
    std::size_t replayed = 0;
    std::size_t unique = 0;
    for (int round = 0; round < 12; ++round) {
        for (int i = 0; i < 50; ++i) {
            car1->send(*car2, "to 2, " + std::to_string(unique));
            car2->send(*car1, "to 1, " + std::to_string(unique));
            ++unique;
            network.run(5ms);
        }
        recorded.insert(recorded.end(), network.sent.begin(), network.sent.end());
        network.sent.clear();
        const auto had1 = car1->opened_log.size();
        const auto had2 = car2->opened_log.size();
        const auto known1 = car1->established_log.size();
        const auto known2 = car2->established_log.size();
        for (const auto& d : recorded) {
            (d.to == car1->at ? *car1 : *car2).receive(d.from, d.content);
            ++replayed;
        }
        BOOST_TEST(car1->opened_log.size() == had1);
        BOOST_TEST(car2->opened_log.size() == had2);
        BOOST_TEST(car1->established_log.size() == known1);
        BOOST_TEST(car2->established_log.size() == known2);
        network.run(15s); // what the replays have begun ends
        BOOST_TEST(car1->sessions.half_open() == 0U);
        network.sent.clear();
        auto& car = round % 2 == 0 ? car1 : car2;
        restart(car, ++epoch);
        for (const auto& d : recorded) { // before it has any session
            if (d.to == car->at) {
                car->receive(d.from, d.content);
                ++replayed;
            }
        }
        BOOST_TEST(car->opened_log.empty());
        BOOST_TEST(car->established_log.empty());
        network.run(15s);
        network.sent.clear();
        // The one that was not restarted finds out.
        auto& other = round % 2 == 0 ? car2 : car1;
        const auto sent = network.now;
        network.run(1ms);
        other->sessions.check_peer(car->source(), sent, network.now);
        network.run(100ms);
        BOOST_REQUIRE(!other->established_log.empty());
        BOOST_TEST(other->established_log.back().restarted);
        network.sent.clear();
    }
    BOOST_TEST(replayed >= 10000U);
    BOOST_TEST_MESSAGE(replayed << " datagrams replayed");
}

BOOST_AUTO_TEST_CASE(each_line_is_opened_once_whatever_the_network_does) {
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
        test_fleet fleet_{2};
        sealed_network lossy{seed};
        lossy.with = {.loss = static_cast<double>(seed % 5) * 0.1,
                      .repetition = 0.3,
                      .longest_delay = std::chrono::milliseconds{seed % 3 == 0 ? 300 : 20}};
        sealed_node one{lossy, fleet_, 1, at(1), 1};
        sealed_node two{lossy, fleet_, 2, at(2), 2};
        for (int i = 0; i < 40; ++i) {
            if (seed % 2 == 0 || i % 3 == 0) {
                one.send(two, "one " + std::to_string(i));
            }
            if (i % 2 == 0) {
                two.send(one, "two " + std::to_string(i));
            }
            if (i % 13 == 5) {
                one.contact(two);
            }
            lossy.run(std::chrono::milliseconds{lossy.random() % 100});
        }
        lossy.with.loss = 0;
        lossy.run(5s);
        for (const auto* const node : {&one, &two}) {
            for (const auto& line : node->lines()) {
                BOOST_REQUIRE_MESSAGE(node->count(line) == 1, "seed " << seed << ": " << line);
            }
            for (const auto& session : node->established_log) {
                BOOST_REQUIRE_MESSAGE(!session.restarted, "seed " << seed);
            }
        }
        // Without losses, a request that is sent twice arrives, whatever has been before.
        const auto first_copy = lossy.now;
        one.send(two, "last of one");
        two.send(one, "last of two");
        lossy.run(1s);
        one.sessions.check_peer(two.source(), first_copy, lossy.now);
        two.sessions.check_peer(one.source(), first_copy, lossy.now);
        lossy.run(2s);
        one.send(two, "last of one");
        two.send(one, "last of two");
        lossy.run(2s);
        BOOST_REQUIRE_MESSAGE(two.count("last of one") >= 1, "seed " << seed);
        BOOST_REQUIRE_MESSAGE(one.count("last of two") >= 1, "seed " << seed);
        lossy.run(12s);
        BOOST_REQUIRE_MESSAGE(one.sessions.half_open() + two.sessions.half_open() == 0, "seed " << seed);
        lossy.run(21min);
        BOOST_REQUIRE_MESSAGE(one.sessions.sources() + two.sessions.sources() == 0, "seed " << seed);
        BOOST_REQUIRE_MESSAGE(!one.sessions.next_deadline() && !two.sessions.next_deadline(), "seed " << seed);
    }
}

BOOST_AUTO_TEST_CASE(no_bit_of_data_can_be_changed) {
    establish();
    network.drop = [](const auto&) { return true; };
    std::vector<bytes> sealed;
    for (int i = 0; i < 100; ++i) {
        car1->send(*car2, "PUSH car2:target id=" + std::to_string(i));
        sealed.push_back(network.sent.back().content);
    }
    std::size_t changed = 0;
    for (const auto& datagram : sealed) {
        for (std::size_t bit = 0; bit < datagram.size() * 8; ++bit) {
            auto forged = datagram;
            forged[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
            car2->receive(car1->at, forged);
            ++changed;
        }
        for (std::size_t length = 0; length < datagram.size(); ++length) {
            car2->receive(car1->at, bytes_view{datagram}.first(length));
        }
    }
    BOOST_TEST_MESSAGE(changed << " bits changed");
    BOOST_TEST(car2->opened_log.size() == 1U); // of `establish`
    for (const auto& datagram : sealed) {
        car2->receive(car1->at, datagram); // forged ones do not keep them out
    }
    BOOST_TEST(car2->opened_log.size() == 101U);
}

BOOST_AUTO_TEST_CASE(data_that_is_1024_or_more_late_is_refused) {
    establish();
    network.drop = [](const auto&) { return true; };
    std::vector<bytes> sealed;
    for (int i = 0; i < 1025; ++i) {
        car1->send(*car2, "line " + std::to_string(i));
        sealed.push_back(network.sent.back().content);
    }
    car2->receive(car1->at, sealed[1024]);
    car2->receive(car1->at, sealed[0]);
    BOOST_TEST(car2->count("line 0") == 0U);
    car2->receive(car1->at, sealed[1]);
    BOOST_TEST(car2->count("line 1") == 1U);
}

BOOST_AUTO_TEST_CASE(data_from_another_address_is_refused) {
    establish();
    network.drop = [](const auto&) { return true; };
    car1->send(*car2, "line");
    const auto datagram = last(datagram_kind::data, *car1);
    car2->receive(at(1, 25371), datagram);
    car2->receive(at(3), datagram);
    car2->receive(datagram_path::v4(car1->at.v4_address(), 25370, 1), datagram);
    BOOST_TEST(car2->count("line") == 0U);
    car2->receive(car1->at, datagram);
    BOOST_TEST(car2->count("line") == 1U);
}

BOOST_AUTO_TEST_CASE(data_that_is_sent_back_is_refused) {
    establish();
    car1->send(*car2, "line");
    car1->receive(car2->at, last(datagram_kind::data, *car1));
    network.run(10ms);
    BOOST_TEST(car1->opened_log.empty());
}

BOOST_AUTO_TEST_CASE(group_datagrams_and_lines_are_ignored) {
    establish();
    const auto group = car1->group.seal("UPDATE car1:speed");
    car2->receive(car1->at, group);
    const std::string line = "PUSH car2:target id=1";
    car2->receive(car1->at, {reinterpret_cast<const std::uint8_t*>(line.data()), line.size()});
    car2->receive(car1->at, {});
    BOOST_TEST(car2->opened_log.size() == 1U);
}

// -- limits --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(new_hellos_per_second_are_limited) {
    limits.hellos_per_second = 100;
    restart(car2, 0x22222223);
    network.drop = [](const auto& d) { return d.content[0] == 0x81; };
    std::vector<bytes> hellos;
    for (int i = 0; i < 150; ++i) {
        sealed_node process{network, fleet, 1, at(1, static_cast<std::uint16_t>(1000 + i)), 1};
        process.contact(*car2);
        hellos.push_back(network.sent.back().content);
    }
    network.sent.clear();
    for (const auto& hello : hellos) {
        car2->receive(at(1), hello);
        network.now += 6ms;
    }
    BOOST_TEST(network.count(datagram_kind::welcome) <= 100U);
    BOOST_TEST(network.count(datagram_kind::welcome) >= 60U); // all are of one member
    const auto answered = network.count(datagram_kind::welcome);
    for (int i = 0; i < 100; ++i) {
        car2->receive(at(1), hellos[0]); // not new
    }
    BOOST_TEST(network.count(datagram_kind::welcome) == answered + 100);
}

BOOST_AUTO_TEST_CASE(a_forged_mac_uses_up_nothing) {
    car1->contact(*car2);
    const auto hello = last(datagram_kind::hello, *car1);
    for (int i = 0; i < 10'000; ++i) {
        auto forged = hello;
        forged[50] ^= static_cast<std::uint8_t>(i % 255 + 1);
        car2->receive(car1->at, forged);
    }
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    car2->receive(car1->at, hello);
    BOOST_TEST(network.count(datagram_kind::welcome) == 1U);
}

BOOST_AUTO_TEST_CASE(forged_hellos_without_a_mac_use_up_what_there_is_for_these) {
    car1->contact(*car2);
    const auto marked = last(datagram_kind::hello, *car1);
    const bytes plain(marked.begin(), marked.begin() + 100);
    for (int i = 0; i < 1000; ++i) {
        auto forged = plain;
        forged[50] ^= static_cast<std::uint8_t>(i % 255 + 1);
        car2->receive(at(100 + i), forged);
    }
    car2->receive(car1->at, plain);
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    BOOST_TEST((std::ranges::count(car2->refused_log, hello_refusal::busy) > 900));
    car2->receive(car1->at, marked);
    BOOST_TEST(network.count(datagram_kind::welcome) == 1U);
    network.drop = [](const auto&) { return true; };
    sealed_node older{network, fleet, 3, at(3), 0x33333333}; // is served when there is something left again
    older.contact(*car2);
    auto hello = last(datagram_kind::hello, older);
    hello.resize(100);
    network.run(1s);
    const auto before = network.count(datagram_kind::welcome);
    car2->receive(older.at, hello);
    BOOST_TEST(network.count(datagram_kind::welcome) == before + 1);
}

BOOST_AUTO_TEST_CASE(the_same_hello_is_opened_for_four_addresses) {
    network.drop = [](const auto&) { return true; };
    car1->contact(*car2);
    const auto hello = last(datagram_kind::hello, *car1);
    for (int i = 0; i < 10; ++i) {
        car2->receive(at(100 + i), hello);
    }
    BOOST_TEST(network.count(datagram_kind::welcome) == 4U);
    BOOST_TEST(car2->sessions.half_open() == 4U);
    network.run(1min);
    car2->receive(at(200), hello); // long after
    BOOST_TEST(car2->sessions.half_open() == 0U);
}

BOOST_AUTO_TEST_CASE(hellos_that_were_opened_before_leave_what_there_is_for_new_ones) {
    network.drop = [](const auto&) { return true; };
    std::vector<bytes> recorded;
    for (int i = 0; i < 100; ++i) {
        car1->sessions.forget(2);
        car1->contact(*car2);
        recorded.push_back(last(datagram_kind::hello, *car1));
        car2->receive(car1->at, recorded.back());
        network.now += 1s;
    }
    BOOST_TEST(network.count(datagram_kind::welcome) == 100U);
    network.run(1min);
    for (int host = 100; host < 103; ++host) {
        for (const auto& hello : recorded) {
            car2->receive(at(host), hello);
        }
    }
    BOOST_TEST(network.count(datagram_kind::welcome) > 100U);
    BOOST_TEST(network.count(datagram_kind::welcome) <= 150U);
    const auto before = network.count(datagram_kind::welcome);
    car1->sessions.forget(2);
    car1->contact(*car2);
    car2->receive(car1->at, last(datagram_kind::hello, *car1));
    BOOST_TEST(network.count(datagram_kind::welcome) == before + 1);
}

BOOST_AUTO_TEST_CASE(repeated_hellos_of_one_member_leave_the_shares_of_others) {
    network.drop = [](const auto&) { return true; };
    std::vector<bytes> recorded;
    for (int i = 0; i < 1000; ++i) {
        sealed_node process{network, fleet, 1, at(1, static_cast<std::uint16_t>(1000 + i)), 1};
        process.contact(*car2);
        recorded.push_back(network.sent.back().content);
    }
    network.run(1min);
    network.sent.clear();
    sealed_node car3{network, fleet, 3, at(3), 0x33333333};
    int answered = 0;
    for (std::size_t second = 0; second < 10; ++second) {
        for (std::size_t i = 0; i < recorded.size(); ++i) {
            car2->receive(at(100 + static_cast<int>(i % 200)), recorded[(i * 7 + second) % recorded.size()]);
            network.now += 1ms;
        }
        car3.sessions.forget(2);
        car3.contact(*car2);
        const auto before = network.count(datagram_kind::welcome);
        car2->receive(car3.at, last(datagram_kind::hello, car3));
        answered += network.count(datagram_kind::welcome) > before ? 1 : 0;
    }
    BOOST_TEST(answered == 10);
}

BOOST_AUTO_TEST_CASE(welcomes_per_second_are_limited) {
    limits.hellos_per_second = 100;
    restart(car1, 0x11111112);
    network.drop = [](const auto& d) { return d.content[0] == 0x82; };
    car1->contact(*car2);
    network.run(10ms);
    const auto welcome = last(datagram_kind::welcome, *car2);
    for (int i = 0; i < 30; ++i) {
        auto forged = welcome;
        forged[50] ^= static_cast<std::uint8_t>(i + 1);
        car1->receive(car2->at, forged);
    }
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.empty());
    network.run(100ms);
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(sessions_without_data_are_1024_of_the_newest_for_ten_seconds) {
    limits.hellos_per_second = 1'000'000;
    restart(car2, 0x22222223);
    network.drop = [](const auto&) { return true; };
    std::vector<std::unique_ptr<sealed_node>> processes;
    std::vector<bytes> welcomes;
    for (int i = 0; i < 1026; ++i) {
        processes.push_back(
            std::make_unique<sealed_node>(network, fleet, 1, at(1, static_cast<std::uint16_t>(1000 + i)), 1));
        processes.back()->contact(*car2);
        car2->receive(processes.back()->at, bytes{network.sent.back().content});
        welcomes.push_back(network.sent.back().content);
        network.now += 1us;
    }
    BOOST_TEST(car2->sessions.half_open() == 1024U);
    const auto first_data = [&](std::size_t of) {
        processes[of]->receive(car2->at, welcomes[of]);
        car2->receive(processes[of]->at, bytes{network.sent.back().content});
        return car2->established_log.size();
    };
    BOOST_TEST(first_data(1) == 0U); // too old
    BOOST_TEST(first_data(2) == 1U);
    BOOST_TEST(car2->sessions.half_open() == 1023U);
    network.run(9900ms);
    BOOST_TEST(car2->sessions.half_open() == 1023U);
    network.run(200ms);
    BOOST_TEST(car2->sessions.half_open() == 0U);
}

BOOST_AUTO_TEST_CASE(the_first_data_has_ten_seconds) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->contact(*car2);
    network.run(100ms);
    const auto data = last(datagram_kind::data, *car1);
    network.now += 10s;
    car2->receive(car1->at, data);
    BOOST_TEST(car2->established_log.empty());
}

BOOST_AUTO_TEST_CASE(two_sessions_with_data_are_kept_for_each_source) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83 && d.content.size() > 36; };
    std::vector<bytes> sealed; // one line in each session
    for (int i = 0; i < 3; ++i) {
        car1->contact(*car2);
        network.run(100ms);
        car1->send(*car2, "in session " + std::to_string(i));
        sealed.push_back(network.sent.back().content);
    }
    BOOST_TEST(car2->established_log.size() == 3U);
    for (const auto& datagram : sealed) {
        car2->receive(car1->at, datagram);
    }
    BOOST_TEST(car2->lines() == (strings{"in session 1", "in session 2"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_member_has_a_limited_number_of_sources) {
    limits.sources_per_member = 4;
    restart(car2, 0x22222223);
    std::vector<std::unique_ptr<sealed_node>> processes;
    for (int i = 0; i < 6; ++i) {
        processes.push_back(
            std::make_unique<sealed_node>(network, fleet, 1, at(1, static_cast<std::uint16_t>(1000 + i)), 1));
        processes.back()->contact(*car2);
        network.run(10ms);
        processes.front()->send(*car2, "still used");
        network.run(10ms);
    }
    BOOST_TEST(car2->sessions.sources() == 4U);
    BOOST_TEST(car2->count("still used") == 6U);
    processes[1]->send(*car2, "forgotten");
    processes[5]->send(*car2, "known");
    network.run(10ms);
    BOOST_TEST(car2->count("forgotten") == 0U);
    BOOST_TEST(car2->count("known") == 1U);
}

BOOST_AUTO_TEST_CASE(handshakes_that_this_node_has_begun_are_not_replaced_by_others) {
    limits.sources_per_member = 2;
    restart(car1, 0x11111112);
    network.drop = [](const auto&) { return true; };
    for (int port = 1; port <= 2; ++port) {
        BOOST_TEST(car1->sessions.contact({.path = at(2, static_cast<std::uint16_t>(port)), .member = 2}, network.now));
    }
    BOOST_TEST(!car1->sessions.contact({.path = at(2, 3), .member = 2}, network.now));
    BOOST_TEST(!car1->sessions.send({.path = at(2, 3), .member = 2}, "line", network.now));
    BOOST_TEST(car1->sessions.contact({.path = at(3, 3), .member = 3}, network.now));
    network.run(2s);
    BOOST_TEST(car1->gave_up_log.size() == 3U);
}

// -- time ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(the_initiator_begins_a_new_session_after_15_minutes) {
    establish();
    network.run(15min - 1s);
    car1->send(*car2, "early");
    network.run(100ms);
    BOOST_TEST(network.count(datagram_kind::hello) == 0U);
    network.run(1s);
    car2->send(*car1, "the responder does not");
    BOOST_TEST(network.count(datagram_kind::hello) == 0U);
    network.run(100ms); // the initiator receives it
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
    BOOST_TEST(car1->established_log.size() == 2U);
    BOOST_TEST(!car1->established_log[1].restarted);
    network.run(5min);
    car1->send(*car2, "late"); // the old one has been forgotten
    network.run(100ms);
    BOOST_TEST(car2->count("late") == 1U);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
}

BOOST_AUTO_TEST_CASE(lines_go_on_while_a_new_session_begins) {
    establish();
    network.run(16min);
    for (int i = 0; i < 20; ++i) {
        car1->send(*car2, "line " + std::to_string(i));
        network.run(500us);
    }
    network.run(100ms);
    BOOST_TEST(car2->opened_log.size() == 21U);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
}

BOOST_AUTO_TEST_CASE(a_session_is_forgotten_after_20_minutes) {
    establish();
    network.run(20min - 1s);
    BOOST_TEST(car1->sessions.sources() == 1U);
    BOOST_TEST(car2->sessions.sources() == 1U);
    network.run(1s);
    BOOST_TEST(car1->sessions.sources() == 0U);
    BOOST_TEST(car2->sessions.sources() == 0U);
    BOOST_TEST(!car1->sessions.next_deadline());
    BOOST_TEST(network.sent.empty());
    car2->send(*car1, "anew");
    network.run(100ms);
    BOOST_TEST(car1->count("anew") == 1U);
}

BOOST_AUTO_TEST_CASE(a_session_is_not_used_after_20_minutes_even_if_the_timer_is_late) {
    establish();
    network.drop = [](const auto&) { return true; };
    car1->send(*car2, "old");
    const auto old = last(datagram_kind::data, *car1);
    network.now += 20min;
    car2->receive(car1->at, old);
    BOOST_TEST(car2->count("old") == 0U);
    network.sent.clear();
    BOOST_TEST(car1->send(*car2, "waits"));
    BOOST_TEST(network.count(datagram_kind::data) == 0U);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
}

BOOST_AUTO_TEST_CASE(a_session_without_data_is_forgotten_if_the_timer_is_late) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->contact(*car2);
    network.run(100ms);
    network.now += 21min;
    car1->sessions.on_time(network.now);
    car2->sessions.on_time(network.now);
    BOOST_TEST(car1->sessions.sources() == 0U);
    BOOST_TEST(car2->sessions.half_open() == 0U);
    BOOST_TEST(!car1->sessions.next_deadline());
}

BOOST_AUTO_TEST_CASE(the_initiator_begins_a_new_session_after_many_datagrams) {
    limits.rekey_datagrams = 10;
    for (const bool initiator_sends : {true, false}) {
        restart(car1, 0x11111112);
        restart(car2, 0x22222223);
        establish();
        for (int i = 0; i < 30; ++i) {
            initiator_sends ? car1->send(*car2, "line") : car2->send(*car1, "line");
            network.run(10ms);
        }
        BOOST_TEST((initiator_sends ? car2 : car1)->count("line") == 30U);
        BOOST_TEST(network.count(datagram_kind::hello) >= 2U);
        BOOST_TEST(network.count(datagram_kind::hello) <= 4U);
        BOOST_TEST(std::ranges::all_of(network.sent,
                                       [&](const auto& d) { return d.content[0] != 0x81 || d.from == car1->at; }));
        network.sent.clear();
    }
}

// -- restarts ------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_restart_is_noticed_when_a_request_is_sent_again) {
    establish();
    restart(car2, 0x22222223);
    const auto first_copy = network.now;
    car1->send(*car2, "PUSH car2:target id=7");
    network.run(200ms);
    BOOST_TEST(car2->opened_log.empty());
    car1->sessions.check_peer(car2->source(), first_copy, network.now);
    car1->send(*car2, "PUSH car2:target id=7");
    network.run(100ms);
    BOOST_REQUIRE(car1->established_log.size() == 2);
    BOOST_TEST(car1->established_log[1].restarted);
    BOOST_TEST(car1->established_log[1].stated.epoch == 0x22222223U);
    car1->send(*car2, "next");
    network.run(100ms);
    BOOST_TEST(car2->lines() == strings{"next"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_peer_that_has_answered_since_is_not_checked) {
    establish();
    const auto first_copy = network.now;
    network.run(1ms);
    car2->send(*car1, "id=6 {}");
    network.run(200ms);
    car1->sessions.check_peer(car2->source(), first_copy, network.now);
    BOOST_TEST(network.count(datagram_kind::hello) == 0U);
    car1->sessions.check_peer(car2->source(), network.now, network.now);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
    car1->sessions.check_peer(car2->source(), network.now, network.now); // one has begun
    car1->contact(*car2);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
    network.run(100ms);
    BOOST_TEST(!car1->established_log.back().restarted);
}

BOOST_AUTO_TEST_CASE(what_arrived_with_the_first_copy_is_no_answer_to_it) {
    establish();
    car2->send(*car1, "at the same time");
    network.run(1ms);
    BOOST_REQUIRE(car1->count("at the same time") == 1U);
    car1->sessions.check_peer(car2->source(), network.now, network.now + 200ms);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
}

BOOST_AUTO_TEST_CASE(no_further_session_begins_until_data_has_arrived_in_the_last_one) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->contact(*car2);
    network.run(100ms);
    BOOST_TEST(car1->established_log.size() == 1U);
    car1->contact(*car2);
    car1->sessions.check_peer(car2->source(), network.now, network.now);
    BOOST_TEST(network.count(datagram_kind::hello) == 1U);
}

// They may be copies of what the other process has received.
BOOST_AUTO_TEST_CASE(lines_that_wait_while_the_peer_restarts_are_dropped) {
    car1->held = car2->source();
    establish();
    network.drop = [](const auto&) { return true; };
    network.run(21min); // the session is forgotten, and the epoch is not
    BOOST_TEST(car1->sessions.sources() == 1U);
    restart(car2, 0x22222223);
    network.drop = nullptr;
    car1->send(*car2, "PUSH car2:target id=7");
    network.run(100ms);
    BOOST_TEST(car1->established_log.back().restarted);
    BOOST_TEST(car1->sessions.waiting() == 0U);
    BOOST_TEST(car2->lines().empty());
    car1->send(*car2, "next");
    network.run(100ms);
    BOOST_TEST(car2->lines() == strings{"next"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(what_the_sink_no_longer_holds_is_forgotten) {
    car1->held = car2->source();
    establish();
    network.run(21min);
    BOOST_TEST(car1->sessions.sources() == 1U);
    BOOST_TEST(!car1->sessions.next_deadline());
    car1->sessions.release(car2->source());
    BOOST_TEST(car1->sessions.sources() == 0U);
    car1->contact(*car2);
    network.run(100ms);
    car1->sessions.release(car2->source()); // there is a session
    BOOST_TEST(car1->sessions.sources() == 1U);
}

BOOST_AUTO_TEST_CASE(whether_there_is_an_earlier_session_is_reported_with_the_end_of_a_handshake) {
    network.drop = [](const auto&) { return true; };
    car1->contact(*car2);
    network.run(2s);
    BOOST_TEST(car1->lost_log == std::vector<bool>{true}, boost::test_tools::per_element());
    network.drop = nullptr;
    establish();
    network.drop = [](const auto&) { return true; };
    car1->contact(*car2);
    network.run(2s);
    BOOST_TEST(car1->lost_log == (std::vector<bool>{true, false}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_restarted_initiator_is_reported_to_the_responder) {
    establish();
    restart(car1, 0x11111112);
    car1->send(*car2, "after");
    network.run(100ms);
    BOOST_REQUIRE(car2->established_log.size() == 2);
    BOOST_TEST(car2->established_log[1].restarted);
    BOOST_TEST(car2->opened_log.back().epoch == 0x11111112U);
    car2->send(*car1, "to the new one");
    network.run(100ms);
    BOOST_TEST(car1->count("to the new one") == 1U);
}

BOOST_AUTO_TEST_CASE(data_of_an_earlier_process_is_refused_after_a_later_one) {
    establish();
    network.drop = [](const auto&) { return true; };
    car1->send(*car2, "held back");
    const auto in_session = last(datagram_kind::data, *car1);
    network.drop = [](const auto& d) { return d.content[0] == 0x83; };
    car1->contact(*car2); // a second session, whose first DATA is held back too
    network.run(100ms);
    const auto first_data = last(datagram_kind::data, *car1);
    network.drop = nullptr;
    restart(car1, 0x11111112);
    car1->send(*car2, "new process");
    network.run(100ms);
    BOOST_REQUIRE(car2->established_log.size() == 2);
    car2->receive(car1->at, in_session);
    car2->receive(car1->at, first_data);
    BOOST_TEST(car2->established_log.size() == 2U);
    BOOST_TEST(car2->count("held back") == 0U);
    car2->send(*car1, "to the new process");
    network.run(100ms);
    BOOST_TEST(car1->count("to the new process") == 1U);
}

BOOST_AUTO_TEST_CASE(check_peer_begins_a_session_if_there_is_none) {
    car1->sessions.check_peer(car2->source(), network.now, network.now);
    network.run(100ms);
    BOOST_TEST(car1->established_log.size() == 1U);
    car1->sessions.check_peer({.path = at(9), .member = 9}, network.now, network.now);
    BOOST_TEST(car1->sessions.sources() == 1U);
}

// -- rosters -------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(sessions_with_a_removed_member_end_at_once) {
    sealed_node car3{network, fleet, 3, at(3), 3};
    establish();
    car3.send(*car1, "from 3");
    network.run(100ms);
    fleet.remove(2);
    adopt_roster();
    BOOST_TEST(car1->sessions.sources() == 1U);
    BOOST_TEST(car2->sessions.sources() == 0U); // it knows that it was removed
    BOOST_TEST(!car1->send(*car2, "line"));
    BOOST_TEST(!car2->send(*car1, "line"));
    BOOST_TEST(!car2->contact(*car1));
    car3.send(*car1, "more from 3");
    network.run(100ms);
    BOOST_TEST(car1->count("more from 3") == 1U);
}

BOOST_AUTO_TEST_CASE(data_of_a_removed_member_is_refused) {
    establish();
    car2->send(*car1, "line");
    const auto data = last(datagram_kind::data, *car2);
    network.drop = [](const auto&) { return true; };
    fleet.remove(2);
    static_cast<void>(car1->fleet.offer(fleet.authority.newest().line()));
    car1->receive(car2->at, data);
    BOOST_TEST(car1->opened_log.empty());
}

BOOST_AUTO_TEST_CASE(handshakes_with_a_removed_member_end_at_once) {
    network.drop = [](const auto& d) { return d.content[0] == 0x83 || d.content[0] == 0x82; };
    car1->send(*car2, "line");
    car2->contact(*car1);
    network.run(10ms);
    BOOST_TEST(car1->sessions.half_open() == 1U);
    const auto welcome = last(datagram_kind::welcome, *car2);
    fleet.remove(2);
    static_cast<void>(car1->fleet.offer(fleet.authority.newest().line()));
    BOOST_TEST(car1->sessions.half_open() == 0U);
    BOOST_TEST(car1->sessions.waiting() == 0U);
    BOOST_TEST(car1->sessions.sources() == 0U);
    BOOST_TEST(!car1->sessions.next_deadline());
    car1->receive(car2->at, welcome);
    BOOST_TEST(car1->established_log.empty());
}

BOOST_AUTO_TEST_CASE(a_removed_node_answers_nothing) {
    fleet.remove(1);
    static_cast<void>(car1->fleet.offer(fleet.authority.newest().line()));
    car2->contact(*car1);
    network.run(2s);
    BOOST_TEST(network.count(datagram_kind::welcome) == 0U);
    BOOST_TEST(car2->gave_up_log.size() == 1U);
}

BOOST_AUTO_TEST_CASE(sessions_go_on_under_a_roster_with_the_same_members) {
    establish();
    fleet.authority.rotate();
    fleet.add(4);
    adopt_roster();
    car1->send(*car2, "later");
    network.run(100ms);
    BOOST_TEST(car2->count("later") == 1U);
    BOOST_TEST(network.count(datagram_kind::hello) == 0U);
}

BOOST_AUTO_TEST_CASE(a_member_with_a_new_number_is_another_one) {
    establish();
    fleet.remove(2);
    fleet.add(2);
    adopt_roster();
    BOOST_TEST(car1->sessions.sources() == 0U);
    BOOST_TEST(car2->sessions.sources() == 0U);
    BOOST_TEST(car1->sessions.send({.path = car2->at, .member = 4}, "line", network.now));
    network.run(100ms);
    BOOST_TEST(car2->count("line") == 1U);
}

BOOST_AUTO_TEST_CASE(a_member_with_a_new_name_is_another_one) {
    establish();
    fleet.authority.rotate(); // for the next version
    const auto line = fleet.authority.newest().line();
    const auto start = line.find("\"roster\":") + 9;
    const auto content = replaced(line.substr(start, line.size() - start - 1), "\"car2\"", "\"car7\"");
    const auto signed_by = to_base64url(key_from(200).sign("cles roster 1\n" + content));
    std::string why;
    const auto verdict = car1->fleet.offer(R"({"signature":")" + signed_by + R"(","roster":)" + content + "}", &why);
    BOOST_REQUIRE_MESSAGE((verdict == cles::security::fleet::verdict::adopted), why);
    BOOST_TEST(car1->sessions.sources() == 0U);
}

BOOST_AUTO_TEST_CASE(a_roster_may_change_while_a_line_is_delivered) {
    establish();
    car2->on_opened = [&](const auto&) {
        fleet.remove(1);
        static_cast<void>(car2->fleet.offer(fleet.authority.newest().line()));
    };
    car1->send(*car2, "one");
    car1->send(*car2, "two");
    network.run(100ms);
    BOOST_TEST(car2->count("one") == 1U);
    BOOST_TEST(car2->count("two") == 0U);
    BOOST_TEST(car2->sessions.sources() == 0U);
}

BOOST_AUTO_TEST_CASE(forget_ends_the_sessions_with_one_member) {
    sealed_node car3{network, fleet, 3, at(3), 3};
    establish();
    car3.contact(*car2);
    network.run(100ms);
    car2->sessions.forget(1);
    car1->send(*car2, "lost");
    network.run(100ms);
    BOOST_TEST(car2->count("lost") == 0U);
    BOOST_TEST(car2->sessions.sources() == 1U);
    car2->sessions.forget(1); // nothing is left
    car2->sessions.forget(77);
    BOOST_TEST(car2->sessions.sources() == 1U);
}

// -- processes -----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_child_process_has_no_sessions) {
    establish();
    BOOST_TEST(in_child([&] {
        car1->send(*car2, "line");
        return network.sent.size() == 1 && network.sent[0].content[0] == 0x81; // not DATA with a counter of the parent
    }));
    BOOST_TEST(in_child([&] {
        car1->receive(car2->at, bytes(100));
        return car1->sessions.sources() == 0;
    }));
    BOOST_TEST(in_child([&] {
        car1->sessions.on_time(network.now);
        return car1->sessions.sources() == 0 && !car1->sessions.next_deadline();
    }));
    car1->send(*car2, "line");
    network.run(10ms);
    BOOST_TEST(car2->count("line") == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace datagram_sessions
