// SPDX-License-Identifier: BSL-1.0
// Forwarded updates in a secured fleet (docs/security.md, "Announcements"). car2 forwards those of car3.
#include "node/secured/unconfirmed_updates.hpp"
#include "support/group_recorder.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>

namespace unconfirmed_updates {
namespace {

using namespace std::chrono_literals;
using cles::test::numbers_feed;
using cles::test::scripted_security;

struct fixture {
    fixture() {
        security->challenge = "AAAAAAAAAAAAAAAAAAAAAA";
        // Updates of nodes that have not announced themselves are not forwarded.
        node.host->peers.apply_announcement({.node = "car3", .tasks = "d"}, 0xB, 1, cles::test::source_at(4001),
                                            node.clock.now());
        link.session().bound().add(feed);
    }

    static std::string update(int seq, const std::string& epoch, const std::string& publisher = "car3") {
        return "UPDATE " + publisher + ":pose seq=" + std::to_string(seq) + " epoch=" + epoch + " {}";
    }
    [[nodiscard]] std::string reply(int id, const std::string& epoch, const std::string& by = "car3") const {
        const std::string said = R"({"node":"car3","endpoints":[]})";
        return "id=" + std::to_string(id) + R"( {"announced":)" + said + R"(,"seq":2,"epoch":")" + epoch +
               R"(","sig":")" +
               scripted_security::signature(by, "cles/announced/" + security->challenge, 2, epoch, said) + "\"}";
    }
    void answer(const std::string& line) {
        link.ask(line);
        node.pass(0ms);
    }
    [[nodiscard]] static bool is_question(const std::string& sent) {
        return sent.starts_with("PULL car3:cles/announced/AAAAAAAAAAAAAAAAAAAAAA id=");
    }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::test::test_link link{node, "car2"};
    numbers_feed feed{"car3", "pose", false, 8};
};

const std::string now_running = "0000000b";
const std::string earlier = "0000000a";

} // namespace
} // namespace unconfirmed_updates

BOOST_FIXTURE_TEST_SUITE(unconfirmed_updates, fixture)

BOOST_AUTO_TEST_CASE(they_are_held_until_the_publisher_has_confirmed_the_epoch) {
    const auto sent = link.ask(update(1, now_running));
    BOOST_TEST(is_question(sent), sent);
    BOOST_TEST(link.ask(update(2, now_running)).empty()); // asked already
    BOOST_TEST(feed.heard.empty());
    answer(reply(1, now_running));
    BOOST_TEST(feed.heard == "1 2 ");
    BOOST_TEST(link.ask(update(3, now_running)).empty());
    BOOST_TEST(feed.heard == "1 2 3 ");
    BOOST_TEST(node.counts().updates_received == 3U);
}

BOOST_AUTO_TEST_CASE(an_update_of_an_earlier_incarnation_is_dropped) {
    link.ask(update(1, now_running));
    answer(reply(1, now_running));
    node.pass(2s);
    BOOST_TEST(is_question(link.ask(update(500, earlier))));
    BOOST_TEST(link.ask(update(2, now_running)).empty()); // what is confirmed does not wait
    answer(reply(2, now_running));
    BOOST_TEST(feed.heard == "1 2 ");
    BOOST_TEST(node.counts().updates_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(a_restart_is_confirmed) {
    link.ask(update(9, earlier));
    answer(reply(1, earlier));
    node.pass(2s);
    link.ask(update(1, now_running));
    answer(reply(2, now_running));
    BOOST_TEST(feed.heard == "9 1 ");
}

BOOST_AUTO_TEST_CASE(a_publisher_is_asked_once_a_second) {
    link.ask(update(1, earlier));
    answer(reply(1, now_running));
    BOOST_TEST(link.ask(update(1, now_running)).empty()); // confirmed
    BOOST_TEST(link.ask(update(2, earlier)).empty());
    node.pass(900ms);
    BOOST_TEST(link.take().empty());
    node.pass(100ms);
    const auto sent = link.take();
    BOOST_TEST(is_question(sent), sent);
    answer(reply(2, earlier));
    BOOST_TEST(feed.heard == "1 2 ");
}

BOOST_AUTO_TEST_CASE(an_update_that_arrives_meanwhile_is_asked_for_next) {
    link.ask(update(1, earlier));
    link.ask(update(1, now_running));
    answer(reply(1, earlier)); // it restarted after that reply
    BOOST_TEST(feed.heard == "1 ");
    node.pass(1s);
    BOOST_TEST(is_question(link.take()));
    answer(reply(2, now_running));
    BOOST_TEST(feed.heard == "1 1 ");
}

BOOST_AUTO_TEST_CASE(without_a_valid_reply_they_are_dropped) {
    link.ask(update(1, now_running));
    answer(reply(1, now_running, "car2")); // the node that forwards has signed it
    node.pass(1s);
    link.ask(update(2, now_running));
    answer("id=2 {\"error\":\"no_target\"}");
    node.pass(1s);
    link.ask(update(3, now_running));
    node.pass(10s); // no reply
    BOOST_TEST(feed.heard.empty());
    BOOST_TEST(node.counts().updates_dropped == 3U);
}

BOOST_AUTO_TEST_CASE(the_peers_own_are_confirmed_by_the_link) {
    numbers_feed own{"car2", "pose", false, 8};
    link.session().bound().add(own);
    BOOST_TEST(link.ask(update(1, now_running, "car2")).empty());
    BOOST_TEST(own.heard == "1 ");
}

BOOST_AUTO_TEST_CASE(unwanted_ones_are_not_held) {
    BOOST_TEST(link.ask(update(1, now_running, "car9")).empty());
    BOOST_TEST(node.counts().updates_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(they_are_bounded) {
    for (std::size_t i = 1; i <= cles::core::unconfirmed_updates::max_lines + 5; ++i) {
        link.ask(update(static_cast<int>(i), now_running));
    }
    BOOST_TEST(node.counts().updates_dropped == 5U);
    const std::string large(cles::core::unconfirmed_updates::max_bytes, 'x');
    cles::test::test_link other{node, "car2"};
    numbers_feed second{"car3", "pose", false, 8};
    other.session().bound().add(second);
    other.ask("UPDATE car3:pose seq=1 epoch=" + now_running + " {\"x\":\"" + large + "\"}");
    BOOST_TEST(node.counts().updates_dropped == 6U);
}

BOOST_AUTO_TEST_CASE(a_link_that_ends_takes_them_along) {
    {
        cles::test::test_link other{node, "car2"};
        numbers_feed second{"car3", "pose", false, 8};
        other.session().bound().add(second);
        BOOST_TEST(is_question(other.ask(update(1, now_running))));
        other.reset();
        BOOST_TEST(second.heard.empty());
    }
    node.pass(20s);
}

BOOST_AUTO_TEST_CASE(without_security_nothing_is_held) {
    cles::test::test_node open;
    cles::test::test_link to{open};
    numbers_feed heard{"car3", "pose", false, 8};
    to.session().bound().add(heard);
    BOOST_TEST(to.ask(update(1, now_running)).empty());
    BOOST_TEST(heard.heard == "1 ");
}

BOOST_AUTO_TEST_SUITE_END()
