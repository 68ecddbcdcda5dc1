// SPDX-License-Identifier: BSL-1.0
#include "node/routing/deferred_request.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace scatter_gather {
namespace {

struct fixture : cles::test::routing_fixture {
    fixture() {
        offer("car2", task("PULL", "speed") + "," + task("DELEGATE", "work"));
        offer("car3", task("PULL", "speed") + "," + task("DELEGATE", "work"));
        offer("car4", task("PULL", "other"));
    }
};

} // namespace
} // namespace scatter_gather

BOOST_FIXTURE_TEST_SUITE(scatter_gather, fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(all_providers_are_asked_including_this_node) {
    node.on(verb::pull, "speed", "1");
    link.ask("PULL all:speed/fast id=7 colour=red");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed/fast hops=7 via=car1 colour=red");
    BOOST_TEST(ways.to("car3").text == "PULL car3:speed/fast hops=7 via=car1 colour=red");
    BOOST_TEST(ways.count_open() == 2U);
    ways.to("car3").answers("{\"value\":3}");
    BOOST_TEST(link.take().empty());
    ways.to("car2").answers("[2]");
    BOOST_TEST(link.take() == R"(id=7 {"results":{"car1":{"value":1},"car2":[2],"car3":{"value":3}},"errors":{}})"
                              "\n");
}

// Its handler may do anything, and must not run between the requests to the others.
BOOST_AUTO_TEST_CASE(this_node_is_asked_last) {
    std::size_t asked = 0;
    node.on(verb::pull, "speed", [&](const cles::request&, cles::json_writer& w) {
        asked = ways.count_open();
        w.value(std::int64_t{1});
    });
    link.ask("PULL all:speed id=7");
    BOOST_TEST(asked == 2U);
}

BOOST_AUTO_TEST_CASE(after_a_wait_it_starts_in_a_turn) {
    node.on_later(verb::delegate, "work");
    hear("car5", "unknown");
    link.ask("DELEGATE all:work id=7 deadline=1000");
    waits_for_turn = true;
    node.pass(500ms); // the known nodes are asked
    BOOST_TEST(node.started.empty());
    BOOST_TEST(ways.to("car2").text.find("work") == std::string::npos, ways.to("car2").text);
    have_turn();
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(ways.to("car2").text.find("work") != std::string::npos, ways.to("car2").text);
    ways.to("car5").answers(description("car5", "")); // it does not start again
    have_turn();
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(failures_are_separate_and_complete) {
    link.ask("PULL all:speed");
    ways.to("car2").refuses(R"({"error":"busy","message":"car2: full","retry_ms":40,"more":1})");
    ways.to("car3").answers("{}");
    BOOST_TEST(link.take() == R"({"results":{"car3":{}},"errors":{"car2":{"error":"busy","message":"car2: full",)"
                              R"("retry_ms":40,"more":1}}})"
                              "\n");
}

BOOST_AUTO_TEST_CASE(unreachable_node_is_listed_in_the_errors) {
    link.ask("PULL all:speed id=7");
    ways.to("car2").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    ways.to("car3").fails(errc::unavailable, "the link was lost");
    BOOST_TEST(link.take() ==
               R"(id=7 {"results":{},"errors":{"car2":{"error":"unavailable","message":"car2: refused"},)"
               R"("car3":{"error":"unavailable","message":"car3: the link was lost"}}})"
               "\n");
}

BOOST_AUTO_TEST_CASE(reply_precedes_the_deadline_with_errors_for_missing_nodes) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE all:work id=7 deadline=1000");
    BOOST_TEST((ways.to("car2").deadline == node.clock.now() + 950ms));
    ways.to("car3").answers("[3]");
    node.pass(949ms);
    BOOST_TEST(link.take().empty());
    node.pass(1ms);
    const auto reply = link.take();
    BOOST_TEST(reply.starts_with(R"(id=7 {"results":{"car3":[3]},"errors":{"car1":{"error":"deadline")"), reply);
    BOOST_TEST(reply.find(R"("car2":{"error":"deadline")") != std::string::npos, reply);
    BOOST_TEST(ways.to("car2").cancelled);
    BOOST_TEST(node.started.at(0)->stopped);
    node.pass(1s);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(at_most_an_eighth_of_a_short_time_is_reserved) {
    link.ask("PULL all:speed deadline=80");
    BOOST_TEST((ways.to("car2").deadline == node.clock.now() + 70ms));
}

BOOST_AUTO_TEST_CASE(no_target_without_a_provider) {
    BOOST_TEST(link.kind("PULL all:nothing id=7") == "id=7 no_target");
    BOOST_TEST(link.kind("PULL all:speed hops=0 id=7") == "id=7 no_target");
    BOOST_TEST(link.kind("PULL all:speed via=car2,car3 id=7") == "id=7 no_target");
}

BOOST_AUTO_TEST_CASE(suspect_node_is_asked_too) {
    node.pass(3600ms);
    link.ask("PULL all:speed id=7");
    BOOST_TEST(ways.count_open() == 2U);
}

BOOST_AUTO_TEST_CASE(cancellation_reaches_all) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE all:work id=7");
    link.ask("PUSH self:cles/cancel/7 reply=no");
    BOOST_TEST(ways.to("car2").cancelled);
    BOOST_TEST(ways.to("car3").cancelled);
    BOOST_TEST(node.started.at(0)->stopped);
    node.started.clear();
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(loss_of_the_requester_reaches_all) {
    link.ask("DELEGATE all:work id=7");
    link.reset();
    BOOST_TEST(ways.count_open() == 0U);
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(reply_that_exceeds_a_line_is_too_large) {
    link.ask("PULL all:speed id=7");
    ways.to("car2").answers("[\"" + std::string(600'000, 'x') + "\"]");
    BOOST_TEST(link.take().empty());
    ways.to("car3").answers("[\"" + std::string(600'000, 'x') + "\"]");
    const auto reply = cles::test::read_reply(link.take());
    BOOST_TEST(reply.error == "too_large");
    BOOST_TEST(reply.ran);
}

BOOST_AUTO_TEST_CASE(results_may_have_the_full_depth) {
    link.ask("PULL all:speed id=7");
    const auto deep = std::string(32, '[') + std::string(32, ']');
    ways.to("car2").answers(deep);
    ways.to("car3").answers("{}");
    BOOST_TEST(link.take().find(deep) != std::string::npos);
}

BOOST_AUTO_TEST_CASE(all_nodes_return_their_identity) {
    link.ask("PULL all:cles id=7");
    BOOST_TEST(ways.count_open() == 3U);
    BOOST_TEST(ways.to("car4").text == "PULL car4:cles hops=7 via=car1");
}

BOOST_AUTO_TEST_CASE(a_push_without_reply_still_reaches_all) {
    offer("car5", task("PUSH", "log"));
    node.on(verb::push, "log", std::string{});
    link.ask("PUSH all:log reply=no {\"x\":1}");
    BOOST_TEST(ways.to("car5").text == "PUSH car5:log hops=7 via=car1 {\"x\":1}");
    ways.to("car5").answers("{}");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(nodes_with_unknown_tasks_are_waited_for_at_most_half_the_time_or_a_second) {
    int names = 0;
    for (const auto& [deadline, wait] : {std::pair{400ms, 200ms}, std::pair{5000ms, 1000ms}}) {
        const auto asked = [&] {
            return ways.to("car2").text.starts_with("PULL car2:speed") && ways.to("car2").open();
        };
        hear("new" + std::to_string(++names), "digest");
        link.ask("PULL all:speed id=8 deadline=" + std::to_string(deadline.count()));
        for (int i = 1; i < 10; ++i) { // there is always another unknown one
            node.pass(wait / 10);
            hear("new" + std::to_string(++names), "digest");
        }
        BOOST_TEST(!asked());
        node.pass(wait / 10);
        BOOST_TEST(asked());
        ways.to("car2").answers("{}");
        ways.to("car3").answers("{}");
        BOOST_TEST(link.take() == "id=8 {\"results\":{\"car2\":{},\"car3\":{}},\"errors\":{}}\n");
        node.pass(1000ms); // no more are expected
    }
}

BOOST_AUTO_TEST_CASE(while_no_node_is_known_to_offer_the_task_it_waits_on) {
    hear("car5", "same");
    hear("car6", "same");
    link.ask("PULL all:height id=9 deadline=5000");
    node.pass(1000ms);
    ways.to("car5").fails(errc::deadline, "no answer was received in time");
    node.pass(999ms);
    BOOST_TEST(link.take().empty());
    ways.to("car6").answers(description("car6", task("PULL", "height")));
    ways.to("car5").answers("5");
    ways.to("car6").answers("6");
    BOOST_TEST(link.take() == "id=9 {\"results\":{\"car5\":5,\"car6\":6},\"errors\":{}}\n");

    hear("car7", "other");
    link.ask("PULL all:depth id=10 deadline=5000");
    node.pass(1000ms);
    BOOST_TEST(link.take().starts_with("id=10 {\"error\":\"no_target\"")); // none is left that may offer it
}

BOOST_AUTO_TEST_SUITE_END()
