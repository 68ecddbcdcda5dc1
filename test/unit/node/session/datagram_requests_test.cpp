// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"
#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

namespace datagram_requests {
namespace {

using cles::verb;
using namespace std::chrono_literals;

constexpr std::size_t datagram = cles::protocol::datagram_bytes;

struct fixture {
    explicit fixture(cles::limits bounds = {}) : node(bounds) {
        node.on(verb::pull, "speed", "42");
        node.on(verb::push, "count", [this](const cles::request&, cles::json_writer& w) {
            ++runs;
            w.value(std::int64_t{runs});
        });
        node.on(verb::update, "notice", [this](const cles::request&, cles::json_writer&) { ++runs; });
        node.on_later(verb::delegate, "drive");
        node.on_later(verb::pull, "slow");
        node.on(verb::pull, "long", "\"" + std::string(1300, 'x') + "\"");
        node.on(verb::push, "long", "\"" + std::string(1300, 'x') + "\"");
    }

    int runs = 0;
    cles::test::test_node node;
    cles::test::test_link link{node, datagram};
    cles::test::test_link other{node, datagram};
};

} // namespace
} // namespace datagram_requests

BOOST_FIXTURE_TEST_SUITE(datagram_requests, fixture)

// -- one line --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_datagram_with_more_than_one_line_is_a_bad_request) {
    const auto told = link.reply("PULL car1:speed\nPULL car1:speed");
    BOOST_TEST(told.error == "bad_request");
    BOOST_TEST(told.message == "car1: a datagram must contain one line");
    BOOST_TEST(link.kind("PULL car1:speed id=7\nPULL car1:speed id=8") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7\n") == "id=7 bad_request");
    BOOST_TEST(link.ask("PUSH car1:count id=7 reply=no\nx").empty());
    BOOST_TEST(runs == 0);
    BOOST_TEST(link.kind("PULL car1:speed id=7\r") == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(a_reply_or_an_update_of_several_lines_is_dropped) {
    BOOST_TEST(link.ask("id=7 {}\nid=8 {}").empty());
    BOOST_TEST(node.counts().replies_dropped == 1U);
    BOOST_TEST(link.ask("UPDATE car2:x seq=1 epoch=0000000a {}\nx").empty());
}

BOOST_AUTO_TEST_CASE(an_update_of_several_lines_is_dropped_in_the_middle_of_a_stream_too) {
    std::string heard;
    cles::test::told_feed feed{"car2", "x", false, [&](const std::string& what) { heard += what + "; "; }};
    link.session().bound().add(feed);
    for (int seq = 1; seq <= 3; ++seq) {
        link.ask("UPDATE car2:x seq=" + std::to_string(seq) + " epoch=0000000a {}");
    }
    link.ask("UPDATE car2:x seq=4 epoch=0000000a {\"a\":\n1}");
    link.ask("UPDATE car2:x seq=5 epoch=0000000a {}");
    BOOST_TEST(heard ==
               "update car2:x 1 {}; update car2:x 2 {}; update car2:x 3 {}; gap car2:x 1; update car2:x 5 {}; ");
}

BOOST_AUTO_TEST_CASE(the_description_of_a_node_fits) {
    const auto told = [&] { return link.ask("PULL car1:cles id=9223372036854775807"); };
    const auto add = [&](int number) {
        node.host->tasks.add(verb::pull, "task" + std::to_string(number),
                             {.info = {.description = std::string(100, 'd')},
                              .plain = [](const cles::request&, cles::json_writer& w) { w.value(true); }});
    };
    BOOST_TEST(told().find("\"tasks\":[") != std::string::npos);
    for (int i = 0; i < 12; ++i) {
        add(i);
    }
    BOOST_TEST(told().find("\"task\":\"task11\"") != std::string::npos);
    BOOST_TEST(told().find("ddd") == std::string::npos);
    for (int i = 12; i < 100; ++i) {
        add(i);
    }
    BOOST_TEST(told().find("\"node\":\"car1\"") != std::string::npos);
    BOOST_TEST(told().find("\"tasks\":null") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(counters_that_are_0_are_left_out_of_the_metrics) {
    cles::test::test_link stream{node};
    BOOST_TEST(stream.ask("PULL car1:cles/metrics").find("\"errors\":0,") != std::string::npos);
    BOOST_TEST(link.ask("PULL car1:cles/metrics").find("\"errors\"") == std::string::npos);
    BOOST_TEST(link.kind("PULL car1:nothing id=7") == "id=7 no_task");
    BOOST_TEST(link.ask("PULL car1:cles/metrics").find("\"errors\":1,") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_datagram_over_the_limit_is_too_large_and_the_source_goes_on) {
    link.overlong("PULL car1:speed id=7 " + std::string(1200, 'x'));
    const auto lines = link.take_lines();
    BOOST_REQUIRE(lines.size() == 1U);
    const auto told = cles::test::read_reply(lines[0]);
    BOOST_TEST(told.id == 7U);
    BOOST_TEST(told.error == "too_large");
    BOOST_TEST(told.message.find("TCP") != std::string::npos);
    BOOST_TEST(link.finishes + link.closes == 0);
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
    link.overlong("id=7 " + std::string(1200, 'x'));
    BOOST_TEST(link.take().empty()); // a reply is never answered
}

BOOST_AUTO_TEST_CASE(http_is_not_answered_and_nothing_is_closed) {
    BOOST_TEST(link.ask("GET / HTTP/1.1").empty());
    BOOST_TEST(link.closes == 0);
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
}

// -- 1200 bytes ------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_reply_over_1200_bytes_becomes_too_large_and_recommends_tcp) {
    const auto told = link.reply("PULL car1:long id=7");
    BOOST_TEST(told.id == 7U);
    BOOST_TEST(told.error == "too_large");
    BOOST_TEST(told.ran);
    BOOST_TEST(told.message.find("use TCP") != std::string::npos, told.message);
    BOOST_TEST(link.reply("PUSH car1:long id=8").ran);
}

BOOST_AUTO_TEST_CASE(a_reply_of_exactly_1200_bytes_is_sent) {
    const std::string head = "id=7 [\"";
    const std::string tail = "\"]\n";
    const std::string fits(1200 - head.size() - tail.size(), 'x');
    node.on(verb::pull, "fits", "[\"" + fits + "\"]");
    node.on(verb::pull, "more", "[\"" + fits + "x\"]");
    BOOST_TEST(link.ask("PULL car1:fits id=7") == head + fits + tail);
    BOOST_TEST(link.kind("PULL car1:more id=7") == "id=7 too_large");
}

BOOST_AUTO_TEST_CASE(a_long_failure_is_truncated) {
    node.on(verb::pull, "talk", [](const cles::request&, cles::json_writer&) {
        throw cles::error{cles::errc::failed, std::string(5000, '"')};
    });
    const auto answer = link.ask("PULL car1:talk id=7");
    BOOST_TEST(answer.size() <= 1200U);
    BOOST_TEST(cles::test::kind_of(answer) == "id=7 failed");
}

BOOST_AUTO_TEST_CASE(progress_that_does_not_fit_is_sent_without_its_details) {
    link.ask("DELEGATE car1:drive id=7 progress=yes");
    node.started.at(0)->call->progress(0.5, "{\"x\":\"" + std::string(1300, 'x') + "\"}");
    BOOST_TEST(link.take() == "id=7 progress=0.5 {}\n");
}

// -- ids -------------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(push_delegate_and_update_need_an_id) {
    BOOST_TEST(link.reply("PUSH car1:count").message == "car1: by datagram, PUSH needs an 'id'");
    BOOST_TEST(link.kind("DELEGATE car1:drive") == "bad_request");
    BOOST_TEST(link.kind("UPDATE car1:notice") == "bad_request");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7") == "bad_request");
    BOOST_TEST(link.ask("PUSH car1:count reply=no").empty());
    BOOST_TEST(node.counts().errors_unsent == 1U);
    BOOST_TEST(runs == 0);
    BOOST_TEST(node.started.empty());
}

BOOST_AUTO_TEST_CASE(pull_and_bind_need_none) {
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
    BOOST_TEST(link.kind("BIND car1:notice") == "ok");
}

BOOST_AUTO_TEST_CASE(requests_without_an_id_are_answered_in_order_per_source) {
    BOOST_TEST(link.ask("PULL car1:slow").empty());
    BOOST_TEST(link.ask("PULL car1:speed").empty());
    BOOST_TEST(other.kind("PULL car1:speed") == "ok"); // another source does not wait
    node.started.at(0)->call->done("{}");
    BOOST_TEST(link.sent() == "ok, ok");
}

// -- at most once ----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_repeated_push_runs_once_and_gets_the_same_reply) {
    const auto first = link.ask("PUSH car1:count id=7");
    BOOST_TEST(first == "id=7 {\"value\":1}\n");
    BOOST_TEST(link.ask("PUSH car1:count id=7") == first);
    node.pass(59s);
    BOOST_TEST(link.ask("PUSH car1:count id=7") == first);
    BOOST_TEST(runs == 1);
    BOOST_TEST(node.counts().requests_repeated == 2U);
    BOOST_TEST(node.counts().requests[static_cast<std::size_t>(verb::push)] == 1U);
}

BOOST_AUTO_TEST_CASE(a_repeated_update_request_publishes_once) {
    link.ask("UPDATE car1:notice id=7 {\"a\":1}");
    link.ask("UPDATE car1:notice id=7 {\"a\":1}");
    BOOST_TEST(runs == 1);
    BOOST_TEST(node.counts().updates_published == 1U);
}

BOOST_AUTO_TEST_CASE(after_60_s_a_repeat_is_a_new_request) {
    link.ask("PUSH car1:count id=7");
    node.pass(60s);
    BOOST_TEST(link.ask("PUSH car1:count id=7") == "id=7 {\"value\":2}\n");
}

BOOST_AUTO_TEST_CASE(a_repeat_of_a_running_request_gets_no_reply_and_later_the_same) {
    link.ask("DELEGATE car1:drive id=7 {}");
    BOOST_TEST(link.ask("DELEGATE car1:drive id=7 {}").empty());
    BOOST_TEST(node.started.size() == 1U);
    node.pass(20s); // however long the first one runs
    BOOST_TEST(link.ask("DELEGATE car1:drive id=7 {}").empty());
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
    node.pass(59s);
    BOOST_TEST(link.ask("DELEGATE car1:drive id=7 {}") == "id=7 [1]\n");
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_failure_is_remembered_like_a_result) {
    link.ask("DELEGATE car1:drive id=7 deadline=1000");
    node.pass(1s);
    const auto told = link.take();
    BOOST_TEST(cles::test::kind_of(told) == "id=7 deadline");
    BOOST_TEST(link.ask("DELEGATE car1:drive id=7 deadline=1000") == told);
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_request_without_a_reply_runs_once_too) {
    BOOST_TEST(link.ask("PUSH car1:count id=7 reply=no").empty());
    BOOST_TEST(link.ask("PUSH car1:count id=7 reply=no").empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(sources_are_independent) {
    link.ask("PUSH car1:count id=7");
    BOOST_TEST(other.ask("PUSH car1:count id=7") == "id=7 {\"value\":2}\n");
    link.ask("DELEGATE car1:drive id=8");
    other.ask("DELEGATE car1:drive id=8");
    BOOST_TEST(node.started.size() == 2U);
}

BOOST_AUTO_TEST_CASE(other_bytes_with_an_answered_id_are_a_new_request) {
    link.ask("PUSH car1:count id=7 {}");
    BOOST_TEST(link.ask("PUSH car1:count id=7 {\"a\":1}") == "id=7 {\"value\":2}\n");
    BOOST_TEST(runs == 2);
}

BOOST_AUTO_TEST_CASE(other_bytes_with_an_id_in_flight_are_a_bad_request_and_nothing_is_closed) {
    link.ask("DELEGATE car1:drive id=7");
    const auto told = link.reply("DELEGATE car1:drive id=7 {\"a\":1}");
    BOOST_TEST(told.error == "bad_request");
    BOOST_TEST(told.id == 7U);
    BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:speed id=7 x") == "id=7 bad_request"); // malformed
    BOOST_TEST(link.finishes + link.closes == 0);
    BOOST_TEST(!node.started.at(0)->stopped);
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
    BOOST_TEST(link.ask("DELEGATE car1:drive id=7") == "id=7 [1]\n"); // the bad_request was not recorded as its reply
}

BOOST_AUTO_TEST_CASE(a_repeated_pull_in_flight_is_not_run_again) {
    link.ask("PULL car1:slow id=7");
    BOOST_TEST(link.ask("PULL car1:slow id=7").empty());
    BOOST_TEST(node.started.size() == 1U);
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
    link.ask("PULL car1:slow id=7"); // answered: it may run again
    BOOST_TEST(node.started.size() == 2U);
}

BOOST_AUTO_TEST_CASE(a_pull_is_not_remembered) {
    for (int i = 0; i < 10; ++i) {
        BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 ok");
    }
    BOOST_TEST(node.host->remembered.used == 0U);
    BOOST_TEST(link.session().is_idle());
}

BOOST_AUTO_TEST_CASE(a_source_is_not_idle_while_a_reply_is_remembered) {
    link.ask("PUSH car1:count id=7");
    BOOST_TEST(!link.session().is_idle());
    node.pass(60s);
    BOOST_TEST(link.session().is_idle());
}

// -- cancellation ----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_request_is_cancelled_by_the_same_source_only) {
    link.ask("DELEGATE car1:drive id=7");
    BOOST_TEST(other.kind("PUSH self:cles/cancel/7 id=1") == "id=1 ok");
    BOOST_TEST(!node.started.at(0)->stopped);
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=7 cancelled, id=8 ok");
    BOOST_TEST(node.started.at(0)->stopped);
    BOOST_TEST(link.kind("DELEGATE car1:drive id=7") == "id=7 cancelled"); // a late copy does not start it again
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=8 ok");
}

// -- memory ----------------------------------------------------------------------------------------------------------

struct small_memory : fixture {
    small_memory() : fixture({.remembered = 20000}) {}
};

BOOST_FIXTURE_TEST_CASE(past_the_memory_new_ones_are_busy_and_old_ones_still_known, small_memory) {
    std::uint64_t id = 1;
    std::string last;
    for (;; ++id) {
        last = link.ask("PUSH car1:count id=" + std::to_string(id));
        if (cles::test::kind_of(last).ends_with("busy")) {
            break;
        }
        BOOST_REQUIRE(id < 1000U);
    }
    const auto ran = runs;
    BOOST_TEST(ran > 10);
    BOOST_TEST(cles::test::read_reply(last).retry_ms.has_value());
    BOOST_TEST(other.kind("PUSH car1:count id=1") == "id=1 busy"); // all sources share the memory
    BOOST_TEST(link.ask("PUSH car1:count id=1") == "id=1 {\"value\":1}\n");
    BOOST_TEST(runs == ran);
    BOOST_TEST(link.kind("PULL car1:speed id=5000") == "id=5000 ok"); // needs none
    BOOST_TEST(link.kind("PUSH self:cles/cancel/1 id=5001") == "id=5001 ok");
    node.pass(60s);
    BOOST_TEST(link.kind("PUSH car1:count id=5002") == "id=5002 ok");
}

BOOST_AUTO_TEST_SUITE_END()
