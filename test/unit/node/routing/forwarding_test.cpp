// SPDX-License-Identifier: BSL-1.0
#include "node/routing/subrequest.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

BOOST_FIXTURE_TEST_SUITE(forwarding, cles::test::routing_fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(request_and_reply_are_forwarded) {
    BOOST_TEST(link.ask("PULL car2:speed/fast id=7").empty());
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed/fast hops=7 via=car1");
    ways.to("car2").answers("{\"v\":3}");
    BOOST_TEST(link.take() == "id=7 {\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(each_verb_except_bind_is_forwarded_with_its_body) {
    for (const std::string line :
         {"PUSH car2:log/a {\"x\":1}", "DELEGATE car2:work [1,2]", "UPDATE car2:note {\"y\":2}"}) {
        link.ask(line + "");
        const auto body = line.substr(line.find_first_of("{["));
        BOOST_TEST(ways.to("car2").text.ends_with(" hops=7 via=car1 " + body), ways.to("car2").text);
        ways.to("car2").answers("{}");
        BOOST_TEST(link.sent() == "ok");
    }
}

BOOST_AUTO_TEST_CASE(remaining_time_is_forwarded) {
    link.ask("PULL car2:speed id=7 deadline=300");
    BOOST_TEST((ways.to("car2").deadline == node.clock.now() + 300ms));
    link.ask("PULL car2:speed");
    link.ask("PULL car2:other");
    node.pass(200ms);
    ways.to("car2").answers("{}");
    link.turn();
    BOOST_TEST(ways.to("car2").text.starts_with("PULL car2:other"));
    BOOST_TEST((ways.to("car2").deadline == node.clock.now() - 200ms + 5s)); // sent late, but its time has been running
}

BOOST_AUTO_TEST_CASE(hops_decrease_and_via_grows) {
    link.ask("PULL car2:speed hops=3 via=car8,car9");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=2 via=car8,car9,car1");
}

BOOST_AUTO_TEST_CASE(no_target_without_hops_left) {
    BOOST_TEST(link.kind("PULL car2:speed hops=0 id=7") == "id=7 no_target");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(the_error_without_hops_left_says_how_many_there_were_and_are_at_most) {
    for (const std::string verb : {"PULL", "BIND"}) {
        const auto said = link.ask(verb + " car2:speed hops=0 via=car7,car8,car9");
        BOOST_TEST(
            said.find("car1: the request for 'car2' has been forwarded 3 times, and hops=3 permits no more: state "
                      "a greater one, at most 16") != std::string::npos,
            said);
    }
}

BOOST_AUTO_TEST_CASE(node_in_via_does_not_forward) {
    BOOST_TEST(link.kind("PULL car2:speed via=car3,car1") == "no_target");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_forwarded_and_known_ones_are_not) {
    link.ask("DELEGATE car2:work id=7 colour=red progress=yes urgent=yes deadline=900 keep=3 x_=1 {\"a\":1}");
    BOOST_TEST(ways.to("car2").text == "DELEGATE car2:work hops=7 via=car1 colour=red keep=3 x_=1 {\"a\":1}");
    BOOST_TEST(ways.to("car2").carried.urgent);
}

BOOST_AUTO_TEST_CASE(unknown_must_is_refused_and_not_forwarded) {
    BOOST_TEST(link.kind("PULL car2:speed must_hurry=1") == "bad_request");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(body_is_checked_before_forwarding) {
    BOOST_TEST(link.kind("PUSH car2:log {\"x\":}") == "bad_request");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(the_access_rules_come_first) {
    cles::test::test_node closed{{}, [](const cles::access&) { return false; }};
    const auto routes = std::make_shared<cles::core::request_router>(closed.host, ways, 1, [] {});
    cles::test::test_link guest{closed};
    for (const std::string_view line : {"PULL car2:speed", "PULL any:speed", "PULL all:speed"}) {
        BOOST_TEST(guest.kind(line) == "denied", line);
    }
    BOOST_TEST(ways.count() == 0U);
    routes->stop();
}

BOOST_AUTO_TEST_CASE(progress_is_forwarded_if_requested) {
    link.ask("DELEGATE car2:work id=7 progress=yes");
    ways.to("car2").progress(0.5, "{\"at\":\"x\"}");
    BOOST_TEST(link.take() == "id=7 progress=0.5 {\"at\":\"x\"}\n");
    ways.to("car2").answers("[1]");
    BOOST_TEST(link.take() == "id=7 [1]\n");
    link.ask("DELEGATE car2:work id=8");
    BOOST_TEST(!ways.to("car2").progress);
}

BOOST_AUTO_TEST_CASE(failure_is_forwarded_completely) {
    const std::string_view failures[] = {R"({"error":"busy","message":"car2: full","retry_ms":40})",
                                         R"({"error":"too_large","message":"car2: it is too long","ran":true})",
                                         R"({"error":"from_the_future","message":"car2: new","more":[1,{"x":2}]})"};
    for (const auto failure : failures) {
        link.ask("PULL car2:speed id=7");
        ways.to("car2").refuses(failure);
        BOOST_TEST(link.take() == "id=7 " + std::string{failure} + "\n");
    }
}

BOOST_AUTO_TEST_CASE(transport_failure_names_the_node) {
    link.ask("PULL car2:speed");
    ways.to("car2").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused),
                          "cannot connect to tcp://10.0.0.2:25370");
    auto told = cles::test::read_reply(link.take());
    BOOST_TEST(told.error == "unavailable");
    BOOST_TEST(told.message.find("car2") != std::string::npos, told.message);
    link.ask("PULL car9:speed");
    ways.to("car9").fails(errc::no_target, "car1 cannot find 'car9'");
    BOOST_TEST(link.sent() == "no_target");
    link.ask("PUSH car2:log");
    ways.to("car2").fails(errc::unavailable, "the link was lost");
    BOOST_TEST(link.sent() == "unavailable");
}

BOOST_AUTO_TEST_CASE(cancellation_is_forwarded) {
    link.ask("DELEGATE car2:work id=7");
    BOOST_TEST(link.kind("PUSH self:cles/cancel/7 id=8") == "id=7 cancelled, id=8 ok");
    BOOST_TEST(ways.to("car2").cancelled);
}

BOOST_AUTO_TEST_CASE(loss_of_the_requester_cancels_it) {
    link.ask("DELEGATE car2:work id=7");
    link.ask("PULL car3:speed");
    link.reset();
    BOOST_TEST(ways.to("car2").cancelled);
    BOOST_TEST(ways.to("car3").cancelled);
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(deadline_cancels_it) {
    link.ask("DELEGATE car2:work id=7 deadline=300");
    node.pass(300ms);
    BOOST_TEST(link.sent() == "id=7 deadline");
    BOOST_TEST(ways.to("car2").cancelled);
}

BOOST_AUTO_TEST_CASE(requests_without_an_id_keep_their_order) {
    node.on(verb::pull, "speed", "{\"v\":3}");
    link.ask("PULL car2:speed");
    BOOST_TEST(link.ask("PULL car1:speed").empty());
    ways.to("car2").answers("{\"v\":2}");
    BOOST_TEST(link.take() == "{\"v\":2}\n{\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(reply_no_is_not_forwarded) {
    link.ask("PUSH car2:log reply=no");
    BOOST_TEST(ways.to("car2").text == "PUSH car2:log hops=7 via=car1");
    ways.to("car2").refuses(R"({"error":"failed","message":"car2: no"})");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(node.counts().errors_unsent == 1U);
}

BOOST_AUTO_TEST_CASE(cancel_by_noun_does_not_reach_other_nodes) {
    BOOST_TEST(link.kind("PUSH car2:cles/cancel/7") == "no_target");
    BOOST_TEST(link.kind("PUSH any:cles/cancel/7 id=3") == "id=3 no_target");
    BOOST_TEST(link.kind("PUSH all:cles/cancel/7") == "no_target");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(forwarded_requests_do_not_count_as_load) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car2:work id=7");
    link.ask("DELEGATE car1:work id=8");
    BOOST_TEST(node.counts().handlers_running == 2U);
    BOOST_TEST(node.host->load_now().running == 1U);
}

BOOST_AUTO_TEST_CASE(busy_beyond_the_limit_of_running_requests) {
    cles::limits few;
    few.running = 1;
    cles::test::test_node small{few};
    const auto routes = std::make_shared<cles::core::request_router>(small.host, ways, 1, [] {});
    cles::test::test_link guest{small};
    guest.ask("PULL car2:speed id=7");
    BOOST_TEST(guest.kind("PULL car2:speed id=8") == "id=8 busy");
    BOOST_TEST(guest.kind("PULL all:speed id=9") == "id=9 busy");
    routes->stop();
}

BOOST_AUTO_TEST_SUITE_END()
