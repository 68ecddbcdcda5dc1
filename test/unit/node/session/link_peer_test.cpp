// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_peer.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <vector>

namespace link_peer {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;

struct fixture : cles::core::link_peer::owner {
    explicit fixture(milliseconds limit = 9s) : peer(*this, deadlines, limit) {}

    [[nodiscard]] bool is_node() const override { return node; }
    [[nodiscard]] bool awaits_peer() const override { return awaits; }
    [[nodiscard]] cles::core::link_traffic traffic() const override { return moved; }
    void ask_peer() override { questions.push_back(elapsed()); }
    void on_hung() override { losses.push_back(elapsed()); }

    [[nodiscard]] milliseconds elapsed() const { return std::chrono::duration_cast<milliseconds>(clock.now() - begun); }
    void pass(milliseconds by) {
        for (; by > 0ms; by -= 100ms) {
            clock.advance(100ms);
            deadlines.expire(clock.now());
        }
    }
    void receive_line() {
        moved.received += 10;
        peer.on_line(clock.now());
    }

    using times = std::vector<milliseconds>;

    cles::test::manual_clock clock;
    cles::time_point begun = clock.now();
    cles::core::deadline_queue deadlines;
    bool node = true;
    bool awaits = true;
    cles::core::link_traffic moved;
    times questions{};
    times losses{};
    cles::core::link_peer peer;
};

struct unlimited : fixture {
    unlimited() : fixture(0s) {}
};

} // namespace
} // namespace link_peer

BOOST_FIXTURE_TEST_SUITE(link_peer, fixture)

BOOST_AUTO_TEST_SUITE(description)

BOOST_AUTO_TEST_CASE(a_peer_is_asked_once_what_it_is) {
    BOOST_TEST(!peer.has_answered());
    BOOST_TEST(!peer.is_learning());
    peer.learn();
    BOOST_TEST(peer.is_learning());
    peer.learn();
    BOOST_TEST(questions.size() == 1U);
    peer.on_described({.node = "car1", .marks = true, .line = 4096});
    BOOST_TEST(peer.has_answered());
    BOOST_TEST(peer.description().node == "car1");
    peer.learn();
    BOOST_TEST(questions.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_peer_that_does_not_say_what_it_is_is_not_asked_again) {
    peer.learn();
    peer.on_undescribed();
    BOOST_TEST(peer.has_answered());
    BOOST_TEST((peer.description() == cles::core::peer_description{}));
    peer.learn();
    BOOST_TEST(questions.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_description_stays_when_a_later_question_fails) {
    peer.learn();
    peer.on_described({.node = "car1"});
    peer.on_undescribed();
    BOOST_TEST(peer.description().node == "car1");
}

BOOST_AUTO_TEST_CASE(another_incarnation_is_asked_anew) {
    peer.learn();
    peer.on_described({.node = "car1"});
    peer.forget();
    BOOST_TEST(!peer.has_answered());
    peer.learn();
    BOOST_TEST(questions.size() == 2U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(life)

BOOST_AUTO_TEST_CASE(a_silent_node_is_asked_after_a_third_of_the_limit_and_lost_at_the_limit) {
    peer.watch(clock.now());
    pass(2'900ms);
    BOOST_TEST(questions.empty());
    pass(100ms);
    BOOST_TEST((questions == times{3s}));
    pass(5'900ms);
    BOOST_TEST(losses.empty());
    pass(100ms);
    BOOST_TEST((losses == times{9s}));
    BOOST_TEST(questions.size() == 1U);
    pass(1min);
    BOOST_TEST(losses.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_that_answers_is_asked_again_after_the_next_silence) {
    peer.watch(clock.now());
    pass(3s);
    pass(500ms);
    receive_line();
    pass(8'900ms);
    BOOST_TEST((questions == times{3s, 6'500ms}));
    BOOST_TEST(losses.empty());
    pass(100ms);
    BOOST_TEST((losses == times{12'500ms}));
}

BOOST_AUTO_TEST_CASE(a_node_whose_lines_arrive_is_never_asked) {
    peer.watch(clock.now());
    for (int i = 0; i < 60; ++i) {
        pass(1s);
        receive_line();
    }
    BOOST_TEST(questions.empty());
}

BOOST_AUTO_TEST_CASE(a_peer_from_which_nothing_is_awaited_is_not_asked) {
    awaits = false;
    peer.watch(clock.now());
    pass(1min);
    BOOST_TEST(questions.empty());
    BOOST_TEST(deadlines.size() == 0U);
    awaits = true;
    BOOST_TEST(!peer.is_watched());
    peer.watch(clock.now()); // silence counts from here
    pass(2'900ms);
    BOOST_TEST(questions.empty());
    pass(6'100ms);
    BOOST_TEST(losses.size() == 1U);
}

BOOST_AUTO_TEST_CASE(who_stops_waiting_loses_nothing) {
    peer.watch(clock.now());
    pass(5s);
    BOOST_TEST(questions.size() == 1U);
    awaits = false;
    pass(1min);
    BOOST_TEST(losses.empty());
}

BOOST_AUTO_TEST_CASE(a_stranger_is_never_asked_nor_lost) {
    node = false;
    peer.watch(clock.now());
    pass(10min);
    BOOST_TEST(questions.empty());
    BOOST_TEST(losses.empty());
}

BOOST_AUTO_TEST_CASE(a_stranger_that_has_described_itself_on_the_link_counts_as_a_node) {
    node = false;
    peer.on_described({.node = "car1"});
    peer.watch(clock.now());
    pass(9s);
    BOOST_TEST(questions.size() == 1U);
    BOOST_TEST(losses.size() == 1U);
}

BOOST_AUTO_TEST_CASE(who_becomes_known_as_a_node_late_has_time_to_answer) {
    node = false;
    peer.watch(clock.now());
    pass(30s);
    node = true;
    pass(3s);
    BOOST_TEST((questions == times{33s}));
    pass(5'900ms);
    BOOST_TEST(losses.empty());
    pass(100ms);
    BOOST_TEST((losses == times{39s}));
}

BOOST_AUTO_TEST_CASE(a_long_line_on_its_way_is_life) {
    peer.watch(clock.now());
    pass(3s);
    moved.received += 1000; // a part of a line
    pass(6s);
    BOOST_TEST(losses.empty());
    pass(3s);
    BOOST_TEST((questions == times{3s, 12s}));
    pass(6s);
    BOOST_TEST((losses == times{18s}));
}

BOOST_AUTO_TEST_CASE(a_peer_that_still_takes_a_long_line_of_this_node_is_alive) {
    moved.unsent = 1'000'000;
    peer.watch(clock.now());
    pass(3s);
    moved.sent += 65'536;
    moved.unsent -= 65'536;
    pass(6s);
    BOOST_TEST(losses.empty());
    pass(9s); // takes no more
    BOOST_TEST((losses == times{18s}));
}

BOOST_AUTO_TEST_CASE(what_the_system_takes_at_once_proves_nothing) {
    peer.watch(clock.now());
    pass(3s);
    moved.sent += 100; // the question
    pass(6s);
    BOOST_TEST(losses.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_link_that_this_node_does_not_read_is_not_silent) {
    moved.reads = false;
    peer.watch(clock.now());
    pass(1min);
    BOOST_TEST(questions.empty());
    moved.reads = true;
    pass(8'900ms);
    BOOST_TEST(losses.empty());
    pass(100ms);
    BOOST_TEST(losses.size() == 1U);
}

// What has arrived meanwhile is not read yet.
BOOST_AUTO_TEST_CASE(silence_during_a_suspension_of_this_node_does_not_count) {
    peer.watch(clock.now());
    pass(3s);
    clock.advance(1h);
    deadlines.expire(clock.now());
    BOOST_TEST(losses.empty());
    pass(8'900ms);
    BOOST_TEST(losses.empty());
    pass(100ms);
    BOOST_TEST(losses.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_link_that_ends_is_not_watched) {
    peer.watch(clock.now());
    peer.stop();
    pass(1min);
    BOOST_TEST(questions.empty());
}

BOOST_FIXTURE_TEST_CASE(without_a_limit_a_peer_may_be_silent_for_ever, unlimited) {
    BOOST_TEST(peer.is_watched()); // there is nothing to do
    peer.watch(clock.now());
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
