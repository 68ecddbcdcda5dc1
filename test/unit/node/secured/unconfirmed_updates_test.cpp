// SPDX-License-Identifier: BSL-1.0
// Forwarded updates in a secured fleet (docs/protocol_security.md, "Announcements"). car2 forwards those of car3, which
// has not announced itself here.
#include <cles/error.hpp>

#include "node/secured/unconfirmed_updates.hpp"
#include "support/group_recorder.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace unconfirmed_updates {
namespace {

using namespace std::chrono_literals;
using cles::test::numbers_feed;
using cles::test::scripted_security;

const std::string now_running = "0000000b";
const std::string earlier = "0000000a";

struct fixture {
    fixture() {
        security->challenge = "AAAAAAAAAAAAAAAAAAAAAA";
        link.session().bound().add(feed);
    }

    static std::string update(int seq, const std::string& epoch, const std::string& publisher = "car3") {
        return "UPDATE " + publisher + ":pose seq=" + std::to_string(seq) + " epoch=" + epoch + " {}";
    }
    /// An update that this node has signed.
    static std::string signed_update(int seq, const std::string& by) {
        const auto sig = scripted_security::signature(by, "pose", static_cast<std::uint64_t>(seq), now_running, "{}");
        return "UPDATE car3:pose seq=" + std::to_string(seq) + " epoch=" + now_running + " sig=" + sig + " {}";
    }
    /// \param tasks whose updates it signs: R"("pose")"
    [[nodiscard]] std::string reply(int id, const std::string& epoch, const std::string& by = "car3",
                                    const std::string& tasks = {}) const {
        const auto said = R"({"node":"car3","endpoints":[],"signed":[)" + tasks + "]}";
        return "id=" + std::to_string(id) + R"( {"announced":)" + said + R"(,"seq":2,"epoch":")" + epoch +
               R"(","sig":")" +
               scripted_security::signature(by, "cles/announced/" + security->challenge, 2, epoch, said) + "\"}";
    }
    void announce(std::vector<std::string> signed_tasks) {
        node.host->peers.apply_announcement({.node = "car3", .tasks = "d", .signed_tasks = std::move(signed_tasks)},
                                            0xB, 1, cles::test::source_at(4001), node.clock.now());
    }
    /// Asks car3 before anything of it arrives, and keeps the outcome in `told`.
    void ask_first() {
        link.session().ask_publisher("car3", node.clock.now() + 5s, [this](const cles::core::peer_answer& found) {
            told += found.code ? found.code.message() + ": " + std::string{found.message} + ". " : "confirmed. ";
        });
    }
    [[nodiscard]] std::uint64_t refused() const { return node.counts().updates_unsigned; }
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
    std::string told;
};

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

BOOST_AUTO_TEST_CASE(a_publisher_that_is_not_in_the_roster_is_not_asked) {
    security->members.erase("car3");
    BOOST_TEST(link.ask(update(1, now_running)).empty());
    BOOST_TEST(refused() == 1U);
    BOOST_TEST(node.secured().confirmed().size() == 0U);
}

BOOST_AUTO_TEST_CASE(what_the_publisher_lists_must_be_signed) {
    link.ask(update(1, now_running));
    link.ask(signed_update(2, "car2"));
    link.ask(signed_update(3, "car3"));
    BOOST_TEST(refused() == 0U);
    answer(reply(1, now_running, "car3", R"("pose")"));
    BOOST_TEST(feed.heard == "3 ");
    BOOST_TEST(refused() == 2U);
    BOOST_TEST(link.ask(update(4, now_running)).empty()); // from then on, at once
    BOOST_TEST(refused() == 3U);
}

BOOST_AUTO_TEST_CASE(what_its_announcement_lists_counts_first) {
    announce({"pose"});
    link.ask(update(1, now_running));
    answer(reply(1, now_running));
    BOOST_TEST(feed.heard.empty());
    BOOST_TEST(refused() == 1U);
}

BOOST_AUTO_TEST_CASE(a_publisher_is_asked_before_it_is_bound) {
    ask_first();
    const auto sent = link.take();
    BOOST_TEST(is_question(sent), sent);
    BOOST_TEST(told.empty());
    answer(reply(1, now_running));
    BOOST_TEST(told == "confirmed. ");
    BOOST_TEST(link.ask(update(1, now_running)).empty());
    BOOST_TEST(feed.heard == "1 ");
}

BOOST_AUTO_TEST_CASE(each_that_binds_gets_an_answer_of_its_own) {
    ask_first();
    ask_first();
    answer(reply(2, now_running));
    answer("id=1 {\"error\":\"no_target\",\"message\":\"car2 cannot find 'car3'\"}");
    BOOST_TEST(told ==
               "confirmed. " + make_error_code(cles::errc::no_target).message() + ": car2 cannot find 'car3'. ");
}

BOOST_AUTO_TEST_CASE(a_publisher_that_does_not_confirm_its_epoch_cannot_be_bound) {
    const auto refusal = make_error_code(cles::errc::unavailable).message() +
                         ": car3 does not confirm its epoch with its signature, so its updates do not count. ";
    ask_first();
    answer(reply(1, now_running, "car2")); // the node that forwards has signed it
    BOOST_TEST(told == refusal);
    ask_first();
    answer("id=2 {\"error\":\"no_task\",\"message\":\"car3 has no PULL 'cles'\"}"); // it has no security
    BOOST_TEST(told == refusal + refusal);
    BOOST_TEST(node.secured().confirmed().find("car3") == nullptr);
}

BOOST_AUTO_TEST_CASE(an_answer_to_one_that_binds_delivers_what_is_held) {
    link.ask(update(1, now_running));
    ask_first();
    answer(reply(2, now_running));
    BOOST_TEST(told == "confirmed. ");
    BOOST_TEST(feed.heard == "1 ");
    answer("id=1 {\"error\":\"no_target\"}"); // to the question about that update
    BOOST_TEST(link.ask(update(2, now_running)).empty());
    BOOST_TEST(feed.heard == "1 2 ");
    BOOST_TEST(node.counts().updates_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(one_that_binds_learns_that_the_link_is_lost) {
    ask_first();
    link.reset();
    BOOST_TEST(told == make_error_code(cles::errc::unavailable).message() + ": the link was lost. ");
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
