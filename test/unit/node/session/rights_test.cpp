// SPDX-License-Identifier: BSL-1.0
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace rights {
namespace {

struct fixture {
    fixture() {
        node.on(cles::verb::pull, "speed", "1");
        node.on(cles::verb::push, "note", "{}");
        node.open("pose");
    }

    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::test::test_link link{node, "car2"};
};

} // namespace
} // namespace rights

BOOST_FIXTURE_TEST_SUITE(rights, fixture)

BOOST_AUTO_TEST_CASE(a_member_may_do_what_its_rights_permit) {
    BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 ok");
    security->denied.insert("car2 PULL car1:speed");
    BOOST_TEST(link.kind("PULL car1:speed id=8") == "id=8 denied");
    BOOST_TEST(link.kind("PULL self:speed id=9") == "id=9 denied"); // the rights name the node that serves
    BOOST_TEST(link.kind("PUSH car1:note id=10") == "id=10 ok");
}

BOOST_AUTO_TEST_CASE(a_denial_names_all_of_the_noun_and_is_logged) {
    std::vector<std::string> logged;
    cles::test::test_node car1{{},
                               {},
                               [&](cles::log_level level, const cles::log_entry& entry) {
                                   logged.push_back((level == cles::log_level::info ? "info: " : "other: ") +
                                                    std::string{entry.text} + " [" + std::string{entry.peer} + "]");
                               },
                               {},
                               security};
    cles::test::test_link car2{car1, "car2"};
    security->denied.insert("car2 PULL car1:cles/metrics");
    BOOST_TEST(car2.reply("PULL car1:cles/metrics id=7").message == "car1 does not allow PULL 'cles/metrics'");
    BOOST_REQUIRE_EQUAL(logged.size(), 1U);
    BOOST_TEST(logged.front() ==
               "info: car2 was denied PULL car1:cles/metrics: car1 does not allow PULL 'cles/metrics' "
               "[tcp://127.0.0.1:1]");

    for (int i = 0; i < 20; ++i) { // a peer does not fill the log
        car2.kind("PULL car1:cles/metrics id=8");
    }
    BOOST_TEST(logged.size() == 8U);
    cles::test::test_link car3{car1, "car3"}; // nor silence another one
    security->denied.insert("car3 PULL car1:cles/metrics");
    BOOST_TEST(car3.kind("PULL car1:cles/metrics id=9") == "id=9 denied");
    BOOST_TEST(logged.size() == 9U);
}

BOOST_AUTO_TEST_CASE(others_may_do_nothing) {
    cles::test::test_link nobody{node, ""};
    BOOST_TEST(nobody.kind("PULL car1:speed id=7") == "id=7 denied");
    BOOST_TEST(nobody.kind("PULL car1:cles id=8") == "id=8 denied");
    BOOST_TEST(nobody.kind("PULL car1:cles/roster id=9") == "id=9 denied");
    cles::test::test_link stranger{node, "car9"};
    BOOST_TEST(stranger.kind("PULL car1:speed id=7") == "id=7 denied");
    BOOST_TEST(stranger.kind("PULL car1:cles/roster id=8") == "id=8 denied");
}

BOOST_AUTO_TEST_CASE(a_member_that_was_removed_may_do_nothing) {
    security->members.erase("car2");
    BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 denied");
}

BOOST_AUTO_TEST_CASE(the_roster_is_exempt_and_other_reserved_nouns_are_not) {
    const std::string spans = "car1:cles/trace/4bf92f3577b34da6a3ce929d0e0e4736";
    security->denied = {"car2 PULL car1:cles/roster", "car2 PULL car1:cles", "car2 PULL car1:cles/metrics",
                        "car2 PULL " + spans, "car2 PUSH car1:cles/cancel/5"};
    BOOST_TEST(link.kind("PULL car1:cles/roster id=7") == "id=7 ok");
    BOOST_TEST(link.kind("PUSH car1:cles/cancel/5 id=8") == "id=8 ok");
    BOOST_TEST(link.kind("PULL car1:cles id=9") == "id=9 denied");
    BOOST_TEST(link.kind("PULL car1:cles/metrics id=10") == "id=10 denied");
    BOOST_TEST(link.kind("PULL " + spans + " id=11") == "id=11 denied");
}

BOOST_AUTO_TEST_CASE(rules_of_the_program_narrow_the_rights) {
    cles::test::test_node strict{{}, [](const cles::access& a) { return a.task != "speed"; }, {}, {}, security};
    strict.on(cles::verb::pull, "speed", "1");
    strict.on(cles::verb::pull, "fuel", "1");
    cles::test::test_link to{strict, "car2"};
    BOOST_TEST(to.kind("PULL car1:speed id=7") == "id=7 denied");
    BOOST_TEST(to.kind("PULL car1:fuel id=8") == "id=8 ok");
    security->denied.insert("car2 PULL car1:fuel");
    BOOST_TEST(to.kind("PULL car1:fuel id=9") == "id=9 denied");
}

BOOST_AUTO_TEST_SUITE(forwarded)

BOOST_AUTO_TEST_CASE(the_rights_of_the_stated_requester_apply) {
    security->forwarders = {"car2"};
    security->denied = {"car3 PULL car1:speed", "car2 PUSH car1:note"};
    BOOST_TEST(link.kind("PULL car1:speed id=7 from=car3") == "id=7 denied");
    BOOST_TEST(link.kind("PULL car1:speed id=8") == "id=8 ok");
    BOOST_TEST(link.kind("PUSH car1:note id=9 from=car3") == "id=9 ok");
    BOOST_TEST(link.kind("PUSH car1:note id=10") == "id=10 denied");
}

BOOST_AUTO_TEST_CASE(a_peer_that_may_not_forward_for_the_stated_requester_is_denied) {
    security->forwarders = {};
    BOOST_TEST(link.ask("PULL car1:speed id=7 from=car3") ==
               "id=7 {\"error\":\"denied\",\"message\":\"car1: car2 may not forward requests of car3 "
               "(cles fleet rights car2 --forwards car3)\"}\n");
    BOOST_TEST(link.kind("PUSH car1:note id=8 from=car3") == "id=8 denied");
    BOOST_TEST(link.kind("BIND car1:pose id=9 from=car3") == "id=9 denied");
    BOOST_TEST(link.kind("PULL car1:cles/roster id=10 from=car3") == "id=10 denied"); // although exempt from rights
    BOOST_TEST(link.kind("PUSH car1:cles/cancel/5 id=11 from=car3") == "id=11 denied");
    BOOST_TEST(link.kind("PULL any:speed id=12 from=car3") == "id=12 denied");
    BOOST_TEST(link.kind("PULL car1:speed id=13 from=car2") == "id=13 ok"); // its own name
}

BOOST_AUTO_TEST_CASE(a_requester_that_is_no_member_is_denied) {
    security->forwarders = {"car2"};
    BOOST_TEST(link.ask("PULL car1:speed id=7 from=car9") ==
               "id=7 {\"error\":\"denied\",\"message\":\"car1: 'car9', the requester that is stated, is not a "
               "member\"}\n");
    BOOST_TEST(link.kind("PULL car1:cles/roster id=8 from=car9") == "id=8 denied");
    BOOST_TEST(link.kind("PULL car1:speed id=9 from=a:b") == "id=9 bad_request");
}

BOOST_AUTO_TEST_CASE(a_requester_that_was_removed_is_denied_although_the_forwarder_states_it) {
    security->forwarders = {"car2"};
    BOOST_TEST(link.kind("PULL car1:speed id=7 from=car3") == "id=7 ok");
    security->members.erase("car3");
    BOOST_TEST(link.kind("PULL car1:speed id=8 from=car3") == "id=8 denied");
}

BOOST_AUTO_TEST_CASE(this_node_as_the_stated_requester_has_its_rights_in_the_roster) {
    security->forwarders = {"car2"};
    security->denied = {"car1 PUSH car1:note", "car1 BIND car1:pose"};
    BOOST_TEST(link.kind("PUSH car1:note id=7 from=car1") == "id=7 denied");
    BOOST_TEST(link.kind("BIND car1:pose id=8 from=car1") == "id=8 denied");
    BOOST_TEST(link.kind("PULL car1:speed id=9 from=car1") == "id=9 ok");
    cles::test::test_link own{node, "car1"};
    BOOST_TEST(own.kind("PUSH car1:note id=7") == "id=7 ok"); // what this node asks itself
    security->forwarders = {};
    BOOST_TEST(link.kind("PULL car1:speed id=10 from=car1") == "id=10 denied");
}

BOOST_AUTO_TEST_CASE(it_is_denied_on_every_transport) {
    for (const std::string transport : {"tls", "udp", "unix", "inproc", "pool"}) {
        security->forwarders = {};
        cles::test::test_link by{node, transport == "udp" ? std::size_t{1200} : std::size_t{0},
                                 transport == "inproc" ? std::string{} : std::string{"car2"}, transport};
        BOOST_TEST_CONTEXT(transport) {
            BOOST_TEST(by.kind("PUSH car1:note id=7 from=car3") == "id=7 denied");
            BOOST_TEST(by.kind("PULL car1:speed id=8 from=car9") == "id=8 denied");
            security->forwarders = {"car1", "car2"};
            BOOST_TEST(by.kind("PULL car1:speed id=9 from=car9") == "id=9 denied");
            BOOST_TEST(by.kind("PUSH car1:note id=10 from=car3") == "id=10 ok");
        }
    }
}

BOOST_AUTO_TEST_CASE(handlers_and_access_rules_know_requester_and_forwarder) {
    std::vector<std::string> asked;
    cles::test::test_node strict{{},
                                 [&](const cles::access& a) {
                                     asked.push_back(a.peer.name + " " + std::string{a.requester} + " " +
                                                     std::string{a.forwarded_by});
                                     return true;
                                 },
                                 {},
                                 {},
                                 security};
    std::vector<std::string> served;
    const auto note = [&](const cles::request& r) {
        served.push_back(r.peer().name + " " + std::string{r.requester()} + " " + std::string{r.forwarded_by()});
    };
    strict.on(cles::verb::pull, "speed", [&](const cles::request& r, cles::json_writer& w) {
        note(r);
        w.raw("1");
    });
    strict.host->tasks.add(cles::verb::bind, "pose", {.plain = [&](const cles::request& r, cles::json_writer& w) {
                               note(r);
                               w.raw("{}");
                           }});
    security->forwarders = {"car2"};
    cles::test::test_link by{strict, "car2"};
    const std::vector<std::string> expected{"car2 car3 car2", "car2 car2 ", "car2 car1 car2", "car2 car3 car2"};
    BOOST_TEST(by.kind("PULL car1:speed id=7 from=car3") == "id=7 ok");
    BOOST_TEST(by.kind("PULL car1:speed id=8") == "id=8 ok");
    BOOST_TEST(by.kind("PULL car1:speed id=9 from=car1") == "id=9 ok");
    BOOST_TEST(by.kind("BIND car1:pose id=10 from=car3") == "id=10 ok");
    BOOST_TEST(asked == expected, boost::test_tools::per_element());
    BOOST_TEST(served == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(nobody_has_proved_a_name_without_security) {
    cles::test::test_node open;
    std::string served;
    open.on(cles::verb::pull, "speed", [&](const cles::request& r, cles::json_writer& w) {
        served = std::string{r.requester()} + "-" + std::string{r.forwarded_by()};
        w.raw("1");
    });
    cles::test::test_link by{open};
    BOOST_TEST(by.kind("PULL car1:speed id=7 from=car3 via=car2") == "id=7 ok");
    BOOST_TEST(served == "-");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(bindings)

BOOST_AUTO_TEST_CASE(they_need_the_right_to_bind) {
    security->denied = {"car2 BIND car1:pose"};
    BOOST_TEST(link.kind("BIND car1:pose id=7") == "id=7 denied");
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(it_is_known_when_one_is_no_longer_permitted) {
    BOOST_TEST(link.kind("BIND car1:pose id=7") == "id=7 ok");
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->denied = {"car2 BIND car1:pose"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    BOOST_TEST(link.kind("BIND car1:pose lease=0 id=8") == "id=8 denied");
    security->denied.clear();
    BOOST_TEST(link.kind("BIND car1:pose lease=0 id=9") == "id=9 ok");
    security->denied = {"car2 BIND car1:pose"};
    BOOST_TEST(link.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_CASE(only_those_that_are_no_longer_permitted_end) {
    node.open("speed");
    BOOST_TEST(link.kind("BIND car1:pose id=7") == "id=7 ok");
    BOOST_TEST(link.kind("BIND car1:speed id=8") == "id=8 ok");
    security->denied = {"car2 BIND car1:pose"};
    link.session().serving().drop_forbidden_bindings();
    BOOST_TEST(link.session().serving().bindings() == 1U);
    BOOST_TEST(link.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_CASE(one_that_was_forwarded_is_the_stated_requesters) {
    security->forwarders = {"car2"};
    BOOST_TEST(link.kind("BIND car1:pose id=7 from=car3") == "id=7 ok");
    security->denied = {"car2 BIND car1:pose"};
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->denied = {"car3 BIND car1:pose"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_CASE(all_stated_requesters_of_a_noun_count) {
    security->forwarders = {"car2"};
    BOOST_TEST(link.kind("BIND car1:pose id=7 from=car3") == "id=7 ok");
    BOOST_TEST(link.kind("BIND car1:pose id=8 from=sat1") == "id=8 ok");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    security->denied = {"car3 BIND car1:pose"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    security->denied = {"sat1 BIND car1:pose"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_CASE(one_ends_with_the_right_to_forward_it) {
    security->forwarders = {"car2"};
    BOOST_TEST(link.kind("BIND car1:pose id=7 from=car3") == "id=7 ok");
    security->forwarders = {};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    link.session().serving().drop_forbidden_bindings();
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(how_many_members_a_link_binds_for_is_limited) {
    security->forwarders = {"car2"};
    constexpr auto most = cles::core::bind_requests::max_requesters;
    const auto bind = [&](std::size_t member) {
        const auto name = "m" + std::to_string(member);
        security->members.insert(name);
        return link.kind("BIND car1:pose id=7 from=" + name);
    };
    for (std::size_t i = 0; i < most; ++i) {
        BOOST_REQUIRE(bind(i) == "id=7 ok");
    }
    BOOST_TEST(bind(most) == "id=7 busy");
    BOOST_TEST(bind(0) == "id=7 ok");
    BOOST_TEST(link.kind("BIND car1:pose id=8 lease=0") == "id=8 ok");
    BOOST_TEST(bind(most) == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(nothing_is_kept_without_security) {
    cles::test::test_node open;
    open.open("pose");
    cles::test::test_link to{open};
    BOOST_TEST(to.kind("BIND car1:pose id=7 from=car3") == "id=7 ok");
    BOOST_TEST(to.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
