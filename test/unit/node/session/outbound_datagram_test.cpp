// SPDX-License-Identifier: BSL-1.0
// Requests sent by datagram.

#include "node/session/outbound.hpp"
#include "support/answer.hpp"
#include "support/recorded_reply.hpp"
#include "support/sent_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace outbound_datagram {
namespace {

using cles::errc;
using cles::verb;
using cles::test::outcome;
using namespace std::chrono_literals;

struct fixture {
    std::shared_ptr<outcome> send(std::uint64_t id, verb v = verb::pull, std::chrono::milliseconds limit = 5s,
                                  std::string_view body = {}, cles::core::outbound::progress_function progress = {}) {
        return cles::test::send_on(link, node, {.verb = v, .noun = "car2:speed", .id = id, .body = body}, limit,
                                   std::move(progress));
    }
    /// Advances time in small steps and returns what was sent meanwhile.
    std::vector<std::string> during(std::chrono::milliseconds span) {
        for (auto passed = 0ms; passed < span; passed += 10ms) {
            node.pass(10ms);
        }
        return link.take_lines();
    }

    cles::test::test_node node;
    cles::test::test_link link{node, cles::protocol::datagram_bytes};
};

} // namespace
} // namespace outbound_datagram

BOOST_FIXTURE_TEST_SUITE(outbound_datagram, fixture)

BOOST_AUTO_TEST_CASE(the_same_bytes_are_sent_again_until_the_reply) {
    const auto result = send(1, verb::push);
    const auto first = link.take();
    BOOST_TEST(first == "PUSH car2:speed id=5000000001\n");
    BOOST_TEST(during(190ms).empty());
    const auto copies = during(510ms); // after 200 to 250 ms, then 400 to 500 later
    BOOST_REQUIRE(copies.size() == 1U);
    BOOST_TEST(copies[0] + "\n" == first);
    BOOST_TEST(node.counts().requests_resent == 1U);
    link.ask("id=5000000001 {}");
    BOOST_TEST(result->ended);
    BOOST_TEST(during(5s).empty());
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(copies_end_at_the_deadline_which_counts_from_the_first) {
    const auto result = send(1, verb::pull, 2s);
    link.take();
    const auto copies = during(1990ms);
    BOOST_TEST(copies.size() == 3U); // after 200, 600 and 1400 ms, with jitter
    BOOST_TEST(!result->ended);
    during(10ms);
    BOOST_TEST(result->ended);
    BOOST_TEST(result->code == errc::deadline);
    BOOST_TEST(during(10s).empty());
}

BOOST_AUTO_TEST_CASE(a_job_whose_deadline_passes_is_cancelled_at_the_peer) {
    send(901, verb::delegate, 100ms);
    send(902, verb::pull, 100ms);
    link.take();
    const auto sent = during(100ms);
    BOOST_REQUIRE(sent.size() == 1U);
    BOOST_TEST(sent[0].starts_with("PUSH self:cles/cancel/5000000901 id="), sent[0]);
    BOOST_TEST(during(10s).size() > 0U); // until it is answered, or its own deadline
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

// No link ends from which the peer could learn it.
BOOST_AUTO_TEST_CASE(jobs_and_forwarded_requests_are_cancelled_at_the_peer_when_the_node_stops) {
    send(901, verb::delegate);
    send(902, verb::pull);
    cles::test::send_on(link, node, {.verb = verb::pull, .noun = "car2:speed", .id = 903, .adverbs = "hops=7 via=car1"},
                        5s);
    link.take();
    link.session().asking().stop();
    auto sent = link.take_lines();
    std::sort(sent.begin(), sent.end());
    BOOST_REQUIRE(sent.size() == 2U);
    BOOST_TEST(sent[0].starts_with("PUSH self:cles/cancel/5000000901 id="), sent[0]);
    BOOST_TEST(sent[1].starts_with("PUSH self:cles/cancel/5000000903 id="), sent[1]);
}

BOOST_AUTO_TEST_CASE(a_repeated_reply_is_dropped) {
    const auto result = send(1);
    link.ask("id=5000000001 [1]");
    link.ask("id=5000000001 [2]");
    BOOST_TEST(result->text == "[1]");
    BOOST_TEST(node.counts().replies_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(ids_start_at_random_and_only_on_the_wire) {
    send(1);
    send(2);
    BOOST_TEST(link.take() == "PULL car2:speed id=5000000001\nPULL car2:speed id=5000000002\n");
    link.ask("id=1 [1]"); // not the id that was sent
    BOOST_TEST(node.counts().replies_dropped == 1U);
    BOOST_TEST(link.session().asking().in_flight() == 2U);
}

BOOST_AUTO_TEST_CASE(a_request_over_1200_bytes_is_not_sent_and_recommends_tcp) {
    const auto result = send(1, verb::push, 5s, "\"" + std::string(1300, 'x') + "\"");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(!result->ended); // not inside the initiation
    node.pass(0ms);
    BOOST_TEST(result->ended);
    BOOST_TEST(result->code == errc::too_large);
    BOOST_TEST(result->text.find("use TCP") != std::string::npos);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(a_request_of_exactly_1200_bytes_is_sent) {
    const std::string head = "PUSH car2:speed id=5000000001 ";
    const std::string body(1200 - head.size() - 1, '1');
    send(1, verb::push, 5s, body);
    BOOST_TEST(link.take().size() == 1200U);
    const auto result = send(2, verb::push, 5s, body + "1");
    node.pass(0ms);
    BOOST_TEST(result->code == errc::too_large);
}

BOOST_AUTO_TEST_CASE(a_cancellation_has_an_id_and_is_retransmitted) {
    node.host->next_id = 50;
    const auto result = send(1, verb::delegate, 30s);
    link.take();
    BOOST_TEST(link.session().asking().cancel(1));
    BOOST_TEST(result->code == errc::cancelled);
    BOOST_TEST(link.take() == "PUSH self:cles/cancel/5000000001 id=5000000050\n");
    const auto copies = during(300ms);
    BOOST_REQUIRE(copies.size() == 1U); // of the cancellation, no longer of the request
    BOOST_TEST(copies[0] == "PUSH self:cles/cancel/5000000001 id=5000000050");
    link.ask("id=5000000050 {}");
    BOOST_TEST(during(5s).empty());
}

BOOST_AUTO_TEST_CASE(progress_never_decreases_if_reports_are_reordered) {
    std::vector<double> reports;
    send(1, verb::delegate, 30s, {}, [&](double fraction, std::string_view) { reports.push_back(fraction); });
    for (const auto* fraction : {"0.1", "0.3", "0.2", "0.3", "0.5"}) {
        link.ask("id=5000000001 progress=" + std::string{fraction} + " {}");
    }
    BOOST_TEST((reports == std::vector<double>{0.1, 0.3, 0.3, 0.5}));
}

BOOST_AUTO_TEST_CASE(a_request_that_is_dropped_is_not_sent_again) {
    const auto result = send(1);
    link.take();
    link.session().asking().drop(1);
    BOOST_TEST(result->discarded);
    BOOST_TEST(during(10s).empty());
    link.session().asking().drop(1);
}

BOOST_AUTO_TEST_CASE(the_peer_is_checked_with_each_copy) {
    const auto begun = node.host->time.now();
    send(1, verb::push);
    during(800ms);
    BOOST_REQUIRE(link.checks.size() == 2U);
    BOOST_TEST((link.checks[0] == begun));
    BOOST_TEST((link.checks[1] >= begun + 200ms)); // when the last copy was sent
    BOOST_TEST((link.checks[1] <= begun + 260ms));
}

BOOST_AUTO_TEST_CASE(if_the_peer_has_restarted_what_may_have_run_fails_and_the_rest_is_sent_again) {
    const auto pull = send(1, verb::pull);
    const auto push = send(2, verb::push);
    const auto bind = send(3, verb::bind);
    const auto delegate = send(4, verb::delegate);
    link.take();
    link.session().asking().on_restart(node.host->time.now());
    auto again = link.take_lines();
    std::sort(again.begin(), again.end());
    BOOST_TEST(again == (std::vector<std::string>{"BIND car2:speed id=5000000003", "PULL car2:speed id=5000000001"}),
               boost::test_tools::per_element());
    BOOST_TEST(node.counts().requests_resent == 2U);
    for (const auto& each : {push, delegate}) {
        node.pass(0ms);
        BOOST_TEST(each->ended);
        BOOST_TEST(each->code == errc::unavailable);
    }
    BOOST_TEST(!pull->ended);
    link.ask("id=5000000001 {}");
    link.ask("id=5000000003 {}");
    BOOST_TEST(pull->ended);
    BOOST_TEST(bind->ended);
    BOOST_TEST(node.host->deadlines.size() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
