// SPDX-License-Identifier: BSL-1.0
#include "core/gathering.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace gathering {
namespace {

struct fixture : cles::test::routing_fixture {
    fixture() {
        offer("car2", task("PULL", "speed") + "," + task("DELEGATE", "work"));
        offer("car3", task("PULL", "speed") + "," + task("DELEGATE", "work"));
        offer("car4", task("PULL", "other"));
    }
};

} // namespace
} // namespace gathering

BOOST_FIXTURE_TEST_SUITE(gathering, fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(all_who_offer_it_are_asked_this_node_too) {
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

// Its handler may do anything, and is not to come between those that are asked.
BOOST_AUTO_TEST_CASE(this_node_comes_last) {
    std::size_t asked = 0;
    node.on(verb::pull, "speed", [&](const cles::request&, cles::json_writer& w) {
        asked = ways.count_open();
        w.value(std::int64_t{1});
    });
    link.ask("PULL all:speed id=7");
    BOOST_TEST(asked == 2U);
}

BOOST_AUTO_TEST_CASE(after_a_wait_it_begins_in_a_turn) {
    node.on_later(verb::delegate, "work");
    hear("car5", "unknown");
    link.ask("DELEGATE all:work id=7 deadline=1000");
    waits_for_turn = true;
    node.pass(500ms); // those that are known are asked
    BOOST_TEST(node.started.empty());
    BOOST_TEST(ways.to("car2").text.find("work") == std::string::npos, ways.to("car2").text);
    have_turn();
    BOOST_TEST(node.started.size() == 1U);
    BOOST_TEST(ways.to("car2").text.find("work") != std::string::npos, ways.to("car2").text);
    ways.to("car5").answers(description("car5", "")); // it does not begin once more
    have_turn();
    BOOST_TEST(node.started.size() == 1U);
}

BOOST_AUTO_TEST_CASE(failures_stand_apart_and_whole) {
    link.ask("PULL all:speed");
    ways.to("car2").refuses(R"({"error":"busy","message":"car2: full","retry_ms":40,"more":1})");
    ways.to("car3").answers("{}");
    BOOST_TEST(link.take() == R"({"results":{"car3":{}},"errors":{"car2":{"error":"busy","message":"car2: full",)"
                              R"("retry_ms":40,"more":1}}})"
                              "\n");
}

BOOST_AUTO_TEST_CASE(who_cannot_be_reached_is_among_the_errors) {
    link.ask("PULL all:speed id=7");
    ways.to("car2").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    ways.to("car3").fails(errc::unavailable, "the link was lost");
    BOOST_TEST(link.take() ==
               R"(id=7 {"results":{},"errors":{"car2":{"error":"unavailable","message":"car2: refused"},)"
               R"("car3":{"error":"unavailable","message":"car3: the link was lost"}}})"
               "\n");
}

BOOST_AUTO_TEST_CASE(it_comes_before_the_time_runs_out_with_deadline_for_those_missing) {
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
    BOOST_TEST(ways.to("car2").withdrawn);
    BOOST_TEST(node.started.at(0)->stopped);
    node.pass(1s);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(of_a_short_time_only_an_eighth_is_kept_back) {
    link.ask("PULL all:speed deadline=80");
    BOOST_TEST((ways.to("car2").deadline == node.clock.now() + 70ms));
}

BOOST_AUTO_TEST_CASE(nobody_who_offers_it_is_no_target) {
    BOOST_TEST(link.kind("PULL all:nothing id=7") == "id=7 no_target");
    BOOST_TEST(link.kind("PULL all:speed hops=0 id=7") == "id=7 no_target");
    BOOST_TEST(link.kind("PULL all:speed via=car2,car3 id=7") == "id=7 no_target");
}

BOOST_AUTO_TEST_CASE(who_is_suspect_is_asked_all_the_same) {
    node.pass(3600ms);
    link.ask("PULL all:speed id=7");
    BOOST_TEST(ways.count_open() == 2U);
}

BOOST_AUTO_TEST_CASE(a_withdrawal_reaches_all) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE all:work id=7");
    link.ask("PUSH self:cles/cancel/7 reply=no");
    BOOST_TEST(ways.to("car2").withdrawn);
    BOOST_TEST(ways.to("car3").withdrawn);
    BOOST_TEST(node.started.at(0)->stopped);
    node.started.clear();
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(the_loss_of_the_requester_reaches_all) {
    link.ask("DELEGATE all:work id=7");
    link.reset();
    BOOST_TEST(ways.count_open() == 0U);
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(an_answer_that_outgrows_a_line_is_too_large) {
    link.ask("PULL all:speed id=7");
    ways.to("car2").answers("[\"" + std::string(600'000, 'x') + "\"]");
    BOOST_TEST(link.take().empty());
    ways.to("car3").answers("[\"" + std::string(600'000, 'x') + "\"]");
    const auto reply = cles::test::read_reply(link.take());
    BOOST_TEST(reply.error == "too_large");
    BOOST_TEST(reply.ran);
}

BOOST_AUTO_TEST_CASE(results_may_be_as_deep_as_any) {
    link.ask("PULL all:speed id=7");
    const auto deep = std::string(32, '[') + std::string(32, ']');
    ways.to("car2").answers(deep);
    ways.to("car3").answers("{}");
    BOOST_TEST(link.take().find(deep) != std::string::npos);
}

BOOST_AUTO_TEST_CASE(all_nodes_tell_who_they_are) {
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

BOOST_AUTO_TEST_CASE(who_never_says_what_it_offers_is_waited_for_half_of_the_time_or_a_second) {
    int names = 0;
    for (const auto& [deadline, wait] : {std::pair{400ms, 200ms}, std::pair{5000ms, 1000ms}}) {
        const auto asked = [&] {
            return ways.to("car2").text.starts_with("PULL car2:speed") && ways.to("car2").open();
        };
        hear("new" + std::to_string(++names), "digest");
        link.ask("PULL all:speed id=8 deadline=" + std::to_string(deadline.count()));
        for (int i = 1; i < 10; ++i) { // there is always another
            node.pass(wait / 10);
            hear("new" + std::to_string(++names), "digest");
        }
        BOOST_TEST(!asked());
        node.pass(wait / 10);
        BOOST_TEST(asked());
        ways.to("car2").answers("{}");
        ways.to("car3").answers("{}");
        BOOST_TEST(link.take() == "id=8 {\"results\":{\"car2\":{},\"car3\":{}},\"errors\":{}}\n");
        node.pass(1000ms); // none is expected any more
    }
}

BOOST_AUTO_TEST_SUITE_END()
