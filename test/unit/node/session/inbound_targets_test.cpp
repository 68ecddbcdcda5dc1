// SPDX-License-Identifier: BSL-1.0
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace inbound_targets {
namespace {

using cles::verb;

void offer_all(cles::test::test_node& node) {
    node.on(verb::pull, "speed", "{\"v\":3}");
    node.on(verb::push, "log", [](const cles::request& r, cles::json_writer& w) {
        w.begin_array();
        for (const auto p : r.parameters()) {
            w.value(p);
        }
        w.end_array();
    });
    node.on(verb::delegate, "work", std::string{});
    node.on(verb::update, "notice", std::string{});
    node.open("pose");
}

struct fixture {
    fixture() { offer_all(node); }
    cles::test::test_node node;
    cles::test::test_link link{node};
};

const std::string_view one_of_each[] = {"PULL car1:speed",        "PUSH car1:log",           "DELEGATE car1:work",
                                        "UPDATE car1:notice",     "BIND car1:pose",          "PULL self:cles",
                                        "PULL self:cles/metrics", "PUSH self:cles/cancel/1", "BIND car1:pose lease=0"};

} // namespace
} // namespace inbound_targets

BOOST_FIXTURE_TEST_SUITE(inbound_targets, fixture)

BOOST_AUTO_TEST_SUITE(targets)

BOOST_AUTO_TEST_CASE(self_is_whichever_node_reads_the_line) {
    BOOST_TEST(link.kind("PULL self:speed") == "ok");
    BOOST_TEST(link.kind("PULL car1:speed") == "ok");
}

BOOST_AUTO_TEST_CASE(without_routing_any_all_and_other_nodes_are_no_target) {
    for (const std::string_view line :
         {"PULL any:speed", "PULL all:speed", "PULL car2:speed", "PULL SELF:speed", "BIND all:pose",
          "DELEGATE any:work", "UPDATE car2:notice", "PUSH all:log", "BIND car2:pose lease=0"}) {
        const auto reply = link.reply(line);
        BOOST_TEST(reply.error == "no_target", line);
        BOOST_TEST(reply.message.find("car1") != std::string::npos, reply.message);
    }
}

BOOST_AUTO_TEST_CASE(without_routing_the_error_says_what_any_and_all_need) {
    for (const std::string_view line : {"PULL any:speed", "BIND all:pose"}) {
        const auto said = link.reply(line).message;
        BOOST_TEST(said.find("cles::routing()") != std::string::npos, said);
    }
    BOOST_TEST(link.reply("PULL car2:speed").message ==
               "car1 does not route, and cannot forward a request to 'car2': ask that node itself, or a node that "
               "routes, as clesd does");
}

BOOST_AUTO_TEST_CASE(a_node_that_finds_itself_in_via_answers_no_target) {
    BOOST_TEST(link.kind("PULL car1:speed via=car1") == "no_target");
    BOOST_TEST(link.kind("PULL car1:speed via=car3,car1,car2") == "no_target");
    BOOST_TEST(link.kind("PULL car1:speed via=car3,car11") == "ok");
}

BOOST_AUTO_TEST_CASE(hops_limit_forwarding_only) {
    BOOST_TEST(link.kind("PULL car1:speed hops=0") == "ok");
    BOOST_TEST(link.kind("PULL car1:speed hops=16") == "ok");
}

BOOST_AUTO_TEST_CASE(an_unknown_verb_and_task_is_no_task_and_named) {
    for (const std::string_view line :
         {"PULL car1:load", "PUSH car1:speed", "DELEGATE car1:speed", "UPDATE car1:speed", "BIND car1:speed",
          "PULL car1:pose", "PULL self:cles/nothing", "PULL self:cles/metrics/x", "PUSH self:cles",
          "DELEGATE self:cles", "BIND self:cles", "UPDATE self:cles"}) {
        const auto reply = link.reply(line);
        BOOST_TEST(reply.error == "no_task", line);
        BOOST_TEST(reply.message.starts_with("car1 has no "), reply.message);
    }
    BOOST_TEST(link.reply("PULL car1:load").message == "car1 has no PULL 'load'");
}

BOOST_AUTO_TEST_CASE(parameters_reach_the_handler_decoded) {
    BOOST_TEST(link.ask("PUSH car1:log/a%20b/%C3%A4/1+1/%2f") == "[\"a b\",\"\xC3\xA4\",\"1+1\",\"/\"]\n");
    std::string most = "PUSH car1:log";
    for (int i = 0; i < 32; ++i) {
        most += "/p";
    }
    BOOST_TEST(link.kind(most) == "ok");
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_ignored) { BOOST_TEST(link.kind("PULL car1:speed colour=red x_=1") == "ok"); }

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(access)

BOOST_AUTO_TEST_CASE(deny_all_denies_every_request_the_reserved_tasks_too) {
    cles::test::test_node closed{{}, [](const cles::access&) { return false; }};
    offer_all(closed);
    cles::test::test_link guest{closed};
    for (const auto line : one_of_each) {
        BOOST_TEST(guest.kind(std::string{line} + " id=7") == "id=7 denied", line);
        BOOST_TEST(guest.kind(line) == "denied", line);
    }
    BOOST_TEST(guest.kind("PULL car9:speed") == "denied"); // even where it would be unknown
    BOOST_TEST(guest.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(allow_all_allows_them) {
    for (const auto line : one_of_each) {
        BOOST_TEST(link.kind(std::string{line} + " id=7") == "id=7 ok", line);
    }
}

BOOST_AUTO_TEST_CASE(the_rules_see_who_asks_for_what) {
    std::vector<std::string> seen;
    cles::test::test_node ruled{{}, [&](const cles::access& a) {
                                    seen.push_back(a.peer.transport + " " + std::string{to_string(a.verb)} + " " +
                                                   std::string{a.task} + " " + std::string{a.path});
                                    return true;
                                }};
    offer_all(ruled);
    cles::test::test_link guest{ruled};
    guest.ask("PUSH car1:log/a%41/b");
    guest.ask("BIND car1:pose");
    const std::vector<std::string> expected{"tcp PUSH log log/aA/b", "tcp BIND pose pose"};
    BOOST_TEST(seen == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(the_rules_apply_to_waiting_requests_too) {
    bool open = true;
    cles::test::test_node ruled{{}, [&](const cles::access&) { return open; }};
    ruled.on_later(verb::delegate, "work");
    ruled.on(verb::pull, "speed", "[1]");
    cles::test::test_link guest{ruled};
    guest.ask("DELEGATE car1:work");
    guest.ask("PULL car1:speed");
    open = false;
    ruled.started.at(0)->call->done("[1]");
    BOOST_TEST(guest.sent() == "ok, denied");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
