// SPDX-License-Identifier: BSL-1.0
#include "node/routing/deferred_request.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <set>
#include <string>
#include <string_view>

namespace any_request {
namespace {

struct fixture : cles::test::routing_fixture {
    /// car2 and car3 offer the same tasks.
    void two_others(const std::string& tasks) {
        offer("car2", tasks);
        offer("car3", tasks);
    }
    void two_others(const std::string& verb, const std::string& name, bool idempotent = false) {
        two_others(task(verb, name, idempotent));
    }
};

const std::string_view full = R"({"error":"busy","message":"it is full","retry_ms":40})";

} // namespace
} // namespace any_request

BOOST_FIXTURE_TEST_SUITE(any_request, fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(this_node_serves_it_if_no_other_offers_it) {
    node.on(verb::pull, "speed", "{\"v\":3}");
    BOOST_TEST(link.ask("PULL any:speed id=7") == "id=7 {\"v\":3}\n");
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE any:work/a id=8 [1]");
    BOOST_TEST(node.started.at(0)->parameters.at(0) == "a");
    BOOST_TEST(node.started.at(0)->body == "[1]");
    node.started.at(0)->call->done("{\"x\":1}");
    BOOST_TEST(link.take() == "id=8 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(is_sent_to_a_provider_under_its_name) {
    offer("car2", task("PULL", "other"));
    offer("car3", task("PULL", "speed"));
    link.ask("PULL any:speed/fast id=7 colour=red");
    BOOST_TEST(ways.to("car3").text == "PULL car3:speed/fast hops=7 via=car1 colour=red");
    ways.to("car3").answers("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
}

BOOST_AUTO_TEST_CASE(no_target_without_a_provider) {
    offer("car2", task("PULL", "other"));
    const auto reply = link.reply("PULL any:speed id=7");
    BOOST_TEST(reply.error == "no_target");
    BOOST_TEST(reply.message.find("PULL 'speed'") != std::string::npos, reply.message);
    BOOST_TEST(link.kind("DELEGATE any:other") == "no_target"); // another verb
}

BOOST_AUTO_TEST_CASE(the_less_loaded_of_two_is_chosen) {
    offer("car2", task("DELEGATE", "work"), {.queued = 9, .running = 1, .workers = 1});
    offer("car3", task("DELEGATE", "work"), {.workers = 1});
    for (int i = 1; i < 8; ++i) {
        link.ask("DELEGATE any:work id=" + std::to_string(i));
        BOOST_TEST(ways.open().node == "car3");
        ways.open().answers("{}");
    }
}

BOOST_AUTO_TEST_CASE(given_work_counts_before_it_is_announced) {
    two_others("DELEGATE", "work");
    std::multiset<std::string> asked;
    for (int i = 1; i <= 10; ++i) {
        link.ask("DELEGATE any:work id=" + std::to_string(i));
    }
    std::size_t at_car2 = 0;
    while (ways.count_open() != 0) {
        at_car2 += ways.open().node == "car2" ? 1 : 0;
        ways.open().answers("{}");
    }
    BOOST_TEST(at_car2 == 5U); // alternating, since both are always compared
}

BOOST_AUTO_TEST_CASE(suspect_or_left_node_is_not_chosen) {
    two_others("PULL", "speed");
    node.pass(2s);
    hear("car3", "of car3");
    node.pass(1600ms); // car2 has been silent for more than 3.5 intervals
    for (int i = 1; i < 8; ++i) {
        link.ask("PULL any:speed id=" + std::to_string(i));
        BOOST_TEST(ways.open().node == "car3");
        ways.open().answers("{}");
    }
    link.take();
    leave("car3");
    BOOST_TEST(link.kind("PULL any:speed id=9") == "id=9 no_target");
}

BOOST_AUTO_TEST_CASE(node_in_via_is_not_chosen) {
    two_others("PULL", "speed");
    for (int i = 1; i < 8; ++i) {
        link.ask("PULL any:speed via=car2 id=" + std::to_string(i));
        BOOST_TEST(ways.open().node == "car3");
        ways.open().answers("{}");
    }
    link.take();
    BOOST_TEST(link.kind("PULL any:speed via=car2,car3 id=9") == "id=9 no_target");
}

BOOST_AUTO_TEST_CASE(without_hops_left_only_this_node_is_chosen) {
    two_others("PULL", "speed");
    BOOST_TEST(link.kind("PULL any:speed hops=0") == "no_target");
    node.on(verb::pull, "speed", "{\"v\":3}");
    for (int i = 0; i < 8; ++i) {
        BOOST_TEST(link.kind("PULL any:speed hops=0") == "ok");
    }
}

BOOST_AUTO_TEST_CASE(busy_node_is_skipped) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    const auto first = ways.open().node;
    ways.open().refuses(full);
    BOOST_TEST(ways.open().node != first);
    BOOST_TEST(link.take().empty());
    ways.open().answers("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
}

// A lost link fails all its requests in a loop, and the handler of this node that is next may do anything.
BOOST_AUTO_TEST_CASE(continues_with_another_node_in_a_turn) {
    offer("car2", task("DELEGATE", "work"));
    link.ask("DELEGATE any:work id=7");
    node.on_later(verb::delegate, "work");
    waits_for_turn = true;
    ways.to("car2").refuses(full);
    BOOST_TEST(node.started.empty());
    have_turn();
    BOOST_REQUIRE_EQUAL(node.started.size(), 1U);
    node.started.at(0)->call->done("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
}

BOOST_AUTO_TEST_CASE(cancelled_request_does_not_continue) {
    for (const auto* how : {"withdrawn", "late", "lost", "stopped"}) {
        fixture f;
        f.offer("car2", f.task("DELEGATE", "work"));
        f.link.ask("DELEGATE any:work id=7 deadline=100");
        f.node.on_later(verb::delegate, "work");
        f.waits_for_turn = true;
        f.ways.to("car2").refuses(full);
        const std::string_view what = how;
        if (what == "withdrawn") {
            f.link.ask("PUSH self:cles/cancel/7 reply=no");
        } else if (what == "late") {
            f.node.pass(100ms);
        } else if (what == "lost") {
            f.link.reset();
        } else {
            f.routing->stop();
        }
        f.have_turn();
        BOOST_TEST(f.node.started.empty(), how);
        BOOST_TEST(f.ways.count() == 2U, how); // its description, and the request
    }
}

BOOST_AUTO_TEST_CASE(busy_node_is_avoided_for_its_retry_time) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    const auto first = ways.open().node;
    ways.open().refuses(full);
    ways.open().answers("[1]");
    for (int i = 10; i < 18; ++i) {
        link.ask("DELEGATE any:work id=" + std::to_string(i));
        BOOST_TEST(ways.open().node != first);
        ways.open().answers("{}");
    }
    node.pass(40ms);
    std::set<std::string> asked;
    for (int i = 20; i < 40; ++i) {
        link.ask("DELEGATE any:work id=" + std::to_string(i));
        asked.insert(ways.open().node);
        ways.open().answers("{}");
    }
    BOOST_TEST(asked.size() == 2U);
}

BOOST_AUTO_TEST_CASE(if_all_are_busy_the_reply_has_a_retry_time) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    ways.open().refuses(full);
    ways.open().refuses(R"({"error":"busy","message":"car? is full","retry_ms":900})");
    BOOST_TEST(link.take() == "id=7 " + std::string{full} + "\n");
}

BOOST_AUTO_TEST_CASE(outcome_of_started_work_replaces_an_earlier_busy) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    ways.open().refuses(full);
    ways.open().refuses(R"({"error":"failed","message":"car? has no fuel"})");
    BOOST_TEST(link.sent() == "id=7 failed"); // `busy` would mean that it has not started
}

BOOST_AUTO_TEST_CASE(at_most_three_busy_nodes_are_asked) {
    for (const std::string name : {"car2", "car3", "car4", "car5", "car6"}) {
        offer(name, task("DELEGATE", "work"));
    }
    const auto before = ways.count();
    link.ask("DELEGATE any:work id=7");
    while (ways.count_open() != 0) {
        ways.open().refuses(full);
    }
    BOOST_TEST(ways.count() - before == 3U);
    BOOST_TEST(link.sent() == "id=7 busy");
}

BOOST_AUTO_TEST_CASE(unreachable_node_is_skipped) {
    for (const std::string name : {"car2", "car3", "car4", "car5", "car6"}) {
        offer(name, task("PUSH", "log"));
    }
    const auto before = ways.count();
    link.ask("PUSH any:log id=7");
    for (int i = 0; i < 4; ++i) {
        ways.open().fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    }
    ways.open().answers("{}");
    BOOST_TEST(ways.count() - before == 5U);
    BOOST_TEST(link.sent() == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(node_that_no_longer_offers_it_is_skipped) {
    two_others("PULL", "speed");
    link.ask("PULL any:speed id=7");
    ways.open().refuses(R"({"error":"no_task","message":"car2 has no PULL 'speed'"})");
    ways.open().refuses(R"({"error":"no_target","message":"car3 cannot find it"})");
    BOOST_TEST(link.sent() == "id=7 no_target"); // from the last node
}

BOOST_AUTO_TEST_CASE(started_and_lost_work_is_not_repeated) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    ways.open().fails(errc::unavailable, "the link was lost");
    BOOST_TEST(ways.count_open() == 0U);
    BOOST_TEST(link.sent() == "id=7 unavailable");
}

BOOST_AUTO_TEST_CASE(lost_idempotent_work_is_repeated) {
    two_others("DELEGATE", "work", true);
    link.ask("DELEGATE any:work id=7");
    ways.open().fails(errc::unavailable, "the link was lost");
    ways.open().answers("[1]");
    BOOST_TEST(link.sent() == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(work_lost_twice_is_not_started_a_third_time) {
    two_others("DELEGATE", "work", true);
    offer("car4", task("DELEGATE", "work", true));
    const auto before = ways.count();
    link.ask("DELEGATE any:work id=7");
    ways.open().fails(errc::unavailable, "the link was lost");
    ways.open().refuses(R"({"error":"unavailable","message":"it was lost there too","more":1})");
    BOOST_TEST(ways.count_open() == 0U);
    BOOST_TEST(ways.count() - before == 2U);
    const auto last = link.take();
    BOOST_TEST(last.starts_with(R"(id=7 {"error":"unavailable","message":)"), last);
    BOOST_TEST(last.ends_with("\"ran\":true}\n"), last);
}

BOOST_AUTO_TEST_CASE(work_that_another_router_started_twice_is_not_started_again) {
    two_others("DELEGATE", "work", true);
    link.ask("DELEGATE any:work id=7");
    ways.open().refuses(R"({"error":"unavailable","message":"lost","ran":true})");
    BOOST_TEST(link.take() == "id=7 {\"error\":\"unavailable\",\"message\":\"lost\",\"ran\":true}\n");
}

BOOST_AUTO_TEST_CASE(work_that_may_have_started_is_not_reported_as_busy) {
    two_others("DELEGATE", "work", true);
    link.ask("DELEGATE any:work id=7");
    ways.open().fails(errc::unavailable, "the link was lost");
    ways.open().refuses(full);
    BOOST_TEST(link.sent() == "id=7 unavailable");
}

BOOST_AUTO_TEST_CASE(lost_pull_is_repeated) {
    two_others("PULL", "speed");
    link.ask("PULL any:speed id=7");
    ways.open().fails(errc::unavailable, "the link was lost");
    ways.open().answers("[1]");
    BOOST_TEST(link.sent() == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(reply_of_the_handler_is_returned) {
    two_others("DELEGATE", "work", true);
    for (const std::string_view code : {"failed", "bad_request", "denied", "deadline", "too_large", "cancelled"}) {
        link.ask("DELEGATE any:work id=7");
        ways.open().refuses(R"({"error":")" + std::string{code} + R"(","message":"no"})");
        BOOST_TEST(ways.count_open() == 0U);
        BOOST_TEST(link.sent() == "id=7 " + std::string{code});
    }
}

BOOST_AUTO_TEST_CASE(this_node_is_skipped_if_busy) {
    node.on_later(verb::delegate, "work");
    offer("car2", task("DELEGATE", "work"), {.queued = 100});
    link.ask("DELEGATE any:work id=7");
    node.started.at(0)->call->fail({.code = errc::busy, .message = "full", .retry_ms = 1000});
    BOOST_TEST(ways.open().node == "car2");
    ways.open().answers("[1]");
    BOOST_TEST(link.sent() == "id=7 ok");
    link.ask("DELEGATE any:work id=8"); // within its `retry_ms`
    BOOST_TEST(ways.open().node == "car2");
}

BOOST_AUTO_TEST_CASE(this_node_is_skipped_if_its_handler_in_line_is_busy) {
    node.on(verb::delegate, "work",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::busy, "not now"); });
    offer("car2", task("DELEGATE", "work"), {.queued = 100});
    for (const std::string id : {" id=7", ""}) {
        link.ask("DELEGATE any:work" + id + " [1]");
        BOOST_TEST(ways.open().node == "car2");
        BOOST_TEST(ways.open().text.ends_with("[1]"));
        ways.open().answers("[2]");
        BOOST_TEST(link.take() == (id.empty() ? "[2]\n" : "id=7 [2]\n"));
        node.pass(1s);
    }
    link.ask("DELEGATE any:work id=8");
    ways.open().refuses(full);
    BOOST_TEST(link.sent() == "id=8 busy");
    BOOST_TEST(link.kind("DELEGATE car1:work id=9") == "id=9 busy"); // a request that names it gets its reply
}

BOOST_AUTO_TEST_CASE(own_busy_is_the_reply_without_another_provider) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::busy, "not now"); });
    const auto reply = link.reply("PULL any:speed id=7");
    BOOST_TEST(reply.error == "busy");
    BOOST_TEST(reply.message == "car1: not now");
}

BOOST_AUTO_TEST_CASE(this_node_is_asked_after_another) {
    node.on_later(verb::delegate, "work");
    node.on_later(verb::delegate, "filler");
    for (int i = 1; i < 5; ++i) {
        link.ask("DELEGATE self:filler id=" + std::to_string(i));
    }
    offer("car2", task("DELEGATE", "work"));
    link.ask("DELEGATE any:work id=17 progress=yes");
    ways.open().refuses(full);
    auto& call = *node.started.at(4)->call;
    BOOST_TEST(call.progress(0.5, {}));
    BOOST_TEST(link.take() == "id=17 progress=0.5 {}\n");
    call.done("{\"x\":1}");
    BOOST_TEST(link.take() == "id=17 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(cancellation_reaches_the_serving_node) {
    two_others("DELEGATE", "work");
    link.ask("DELEGATE any:work id=7");
    ways.open().refuses(full);
    auto& second = ways.open();
    link.ask("PUSH self:cles/cancel/7 reply=no");
    BOOST_TEST(second.cancelled);
    BOOST_TEST(ways.count_open() == 0U);
    node.on_later(verb::delegate, "own");
    link.ask("DELEGATE any:own id=8");
    link.ask("PUSH self:cles/cancel/8 reply=no");
    BOOST_TEST(node.started.at(0)->stopped);
    node.started.clear();
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(no_other_node_is_asked_after_the_deadline) {
    two_others("PULL", "speed");
    link.ask("PULL any:speed id=7 deadline=300");
    const auto before = ways.count();
    node.pass(300ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
    BOOST_TEST(ways.count() == before);
    BOOST_TEST(ways.count_open() == 0U);
}

BOOST_AUTO_TEST_CASE(any_node_returns_its_identity) {
    BOOST_TEST(link.ask("PULL any:cles").starts_with("{\"node\":\"car1\""));
}

BOOST_AUTO_TEST_CASE(failure_of_the_own_handler_is_the_reply) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::failed, "no sensor"); });
    BOOST_TEST(link.reply("PULL any:speed").message == "car1: no sensor");
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE any:work id=7");
    node.started.at(0)->call->fail({.code = errc::failed, .message = "no tool"});
    BOOST_TEST(link.take() == "id=7 {\"error\":\"failed\",\"message\":\"car1: no tool\"}\n");
}

BOOST_AUTO_TEST_CASE(update_is_published_by_the_chosen_node) {
    node.on_later(verb::update, "note");
    link.ask("UPDATE any:note id=7 {\"x\": 1}");
    node.started.at(0)->call->done({});
    BOOST_TEST(link.sent() == "id=7 ok");
    BOOST_REQUIRE(node.host->published.find("note") != nullptr);
    BOOST_TEST(node.host->published.find("note")->last_body() == "{\"x\":1}");
}

BOOST_AUTO_TEST_SUITE_END()
