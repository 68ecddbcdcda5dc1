// SPDX-License-Identifier: BSL-1.0
#include "node/secured/request_challenges.hpp"
#include "support/routing_fixture.hpp"
#include "support/scripted_security.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace signed_requests {
namespace {

using cles::verb;
using cles::test::scripted_security;
using namespace std::chrono_literals;

struct security_of_fixture {
    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
};

/// The node car1, whose task `strike` must be signed, and which forwards; its client is car2.
struct fixture : security_of_fixture, cles::test::routing_fixture {
    fixture() : routing_fixture(security, "car2") {
        for (const auto how : {verb::pull, verb::push, verb::delegate, verb::update}) {
            node.host->tasks.add(how, "strike", entry());
        }
        node.host->tasks.add(verb::bind, "strike", {.info = {.must_be_signed = true}});
    }
    cles::core::handler entry() {
        return {.info = {.must_be_signed = true}, .plain = [this](const cles::request&, cles::json_writer& w) {
                    ++runs;
                    w.raw("{}");
                }};
    }

    struct told {
        std::string error;
        std::string node;
        std::string challenge;
        std::string message;
    };
    static told read(std::string_view line) {
        cles::protocol::reply_line reply;
        cles::protocol::failure why;
        BOOST_REQUIRE(cles::protocol::parse_reply(line, reply));
        if (!cles::protocol::is_failure(reply.body)) {
            return {};
        }
        BOOST_REQUIRE(cles::protocol::parse_failure(reply.body, why));
        return {std::string{cles::wire_name(why.code)}, why.node, why.challenge, why.message};
    }
    told ask(const std::string& line) { return read(link.ask(line)); }
    /// The value of `sig=`.
    static std::string signature(std::string_view challenge, std::string_view body = "{\"a\":1}",
                                 std::string_view by = "car2", verb how = verb::delegate,
                                 std::string_view path = "strike/now", std::string_view node = "car1",
                                 std::uint32_t waits_ms = 20'000) {
        return scripted_security::request_signature(by, node, challenge, how, path, body, waits_ms) + "." +
               std::to_string(waits_ms);
    }
    static std::string waiting(std::string_view challenge, std::uint32_t waits_ms) {
        return signature(challenge, "{\"a\":1}", "car2", verb::delegate, "strike/now", "car1", waits_ms);
    }
    const std::string first = "DELEGATE car1:strike/now id=7 {\"a\":1}";
    static std::string second(const std::string& sig) {
        return "DELEGATE car1:strike/now id=8 sig=" + sig + " {\"a\":1}";
    }

    int runs = 0;
};

} // namespace
} // namespace signed_requests

BOOST_FIXTURE_TEST_SUITE(signed_requests, fixture)

BOOST_AUTO_TEST_CASE(the_first_attempt_is_answered_with_a_challenge) {
    BOOST_TEST(link.ask(first) ==
               "id=7 {\"error\":\"denied\",\"message\":\"car1: 'strike' requires signed requests\",\"node\":\"car1\","
               "\"challenge\":\"challenge1\"}\n");
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(a_signed_one_runs_once) {
    const auto given = ask(first);
    const auto sig = signature(given.challenge);
    BOOST_TEST(ask(second(sig)).error.empty());
    BOOST_TEST(runs == 1);
    const auto again = ask(second(sig));
    BOOST_TEST(again.error == "denied");
    BOOST_TEST(again.challenge.empty());
    BOOST_TEST(runs == 1);
    BOOST_TEST(node.secured().challenges().size() == 0U);
}

BOOST_AUTO_TEST_CASE(every_verb_but_bind_must_be_signed) {
    BOOST_TEST(ask("PULL car1:strike id=1").challenge == "challenge1");
    BOOST_TEST(ask("PUSH car1:strike id=2").challenge == "challenge2");
    BOOST_TEST(ask("DELEGATE car1:strike id=3").challenge == "challenge3");
    BOOST_TEST(ask("UPDATE car1:strike id=4 {\"a\":1}").challenge == "challenge4");
    BOOST_TEST(ask("BIND car1:strike id=5").error.empty());
    BOOST_TEST(ask("PULL self:strike id=6").node == "car1");
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(other_tasks_need_no_signature) {
    node.on(verb::pull, "speed", "1");
    BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 ok");
    BOOST_TEST(link.kind("PULL car1:speed id=8 sig=x") == "id=8 ok");
}

BOOST_AUTO_TEST_CASE(a_wrong_signature_is_denied_and_uses_the_challenge_up) {
    const auto given = ask(first);
    BOOST_TEST(ask(second("x")).error == "denied");
    BOOST_TEST(ask(second(signature(given.challenge))).error == "denied");
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(it_is_for_this_request_only) {
    for (const auto& sig : {signature("challenge1", "{\"a\":2}"), signature("challenge1", "{\"a\":1}", "car3"),
                            signature("challenge1", "{\"a\":1}", "car2", verb::push),
                            signature("challenge1", "{\"a\":1}", "car2", verb::delegate, "strike"),
                            signature("challenge1", "{\"a\":1}", "car2", verb::delegate, "strike/now", "sat1")}) {
        security->challenges = 0;
        BOOST_TEST(ask(first).challenge == "challenge1");
        BOOST_TEST(ask(second(sig)).error == "denied");
    }
    security->challenges = 0;
    BOOST_TEST(ask(first).challenge == "challenge1");
    BOOST_TEST(ask("DELEGATE car1:strike/now id=8 sig=" + signature("challenge1", "{\"a\":2}") + " {\"a\":2}").error ==
               "denied"); // signed, but another body than that of the first attempt
    BOOST_TEST(runs == 0);
    BOOST_TEST(ask(second(signature("challenge1"))).error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(it_is_valid_until_the_first_attempts_deadline) {
    const auto attempt = std::string{"DELEGATE car1:strike/now id=7 deadline=1000 {\"a\":1}"};
    const auto early = ask(attempt);
    node.pass(999ms);
    BOOST_TEST(ask(second(signature(early.challenge))).error.empty());
    const auto late = ask(attempt);
    node.pass(1000ms);
    BOOST_TEST(ask(second(signature(late.challenge))).error == "denied");
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(it_is_valid_no_longer_than_the_verbs_default_deadline) {
    const auto attempt = std::string{"DELEGATE car1:strike/now id=7 deadline=86400000 {\"a\":1}"};
    const auto early = ask(attempt);
    node.pass(29'999ms);
    BOOST_TEST(ask(second(waiting(early.challenge, 86'400'000))).error.empty());
    const auto late = ask(attempt);
    node.pass(30s);
    BOOST_TEST(ask(second(waiting(late.challenge, 86'400'000))).error == "denied");
    const auto pull = ask("PULL car1:strike id=7 deadline=86400000");
    node.pass(5s);
    const auto sig = signature(pull.challenge, "", "car2", verb::pull, "strike");
    BOOST_TEST(ask("PULL car1:strike id=8 sig=" + sig).error == "denied");
    BOOST_TEST(runs == 1);
}

// A node that forwards may hold the request and state any deadline.
BOOST_AUTO_TEST_CASE(it_runs_only_as_long_as_its_requester_waits) {
    const auto release = [&](std::string_view challenge) {
        return ask("DELEGATE car1:strike/now id=8 deadline=86400000 sig=" + waiting(challenge, 1'000) + " {\"a\":1}");
    };
    const auto early = ask(first);
    node.pass(999ms);
    BOOST_TEST(release(early.challenge).error.empty());
    const auto late = ask(first);
    node.pass(1'000ms);
    const auto told = release(late.challenge);
    BOOST_TEST(told.error == "denied");
    BOOST_TEST(told.message == "car1 does not accept the signature for 'strike': car2 has stopped waiting");
    BOOST_TEST(node.secured().challenges().size() == 0U);
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(one_that_waits_here_ends_with_its_requesters_patience) {
    std::shared_ptr<cles::core::call> waiting_call;
    cles::time_point stated{};
    node.host->tasks.add(verb::delegate, "aim",
                         {.info = {.must_be_signed = true},
                          .start = [&](const cles::request& r, const std::shared_ptr<cles::core::call>& c) {
                              stated = r.deadline();
                              waiting_call = c;
                          }});
    const auto issued = node.clock.now();
    const auto told = ask("DELEGATE car1:aim id=7");
    node.pass(400ms);
    const auto sig = signature(told.challenge, "", "car2", verb::delegate, "aim", "car1", 1'000);
    BOOST_TEST(link.ask("DELEGATE car1:aim id=8 deadline=86400000 sig=" + sig).empty());
    BOOST_REQUIRE(waiting_call);
    BOOST_TEST((stated == issued + 1s));
    node.pass(599ms);
    BOOST_TEST(!waiting_call->stopped());
    node.pass(1ms);
    BOOST_TEST(waiting_call->stopped());
    BOOST_TEST(read(link.take()).error == "deadline");
}

BOOST_AUTO_TEST_CASE(the_time_that_its_requester_waits_is_signed) {
    const auto given = ask(first);
    auto sig = waiting(given.challenge, 1'000);
    sig += "0"; // 10 s
    BOOST_TEST(ask(second(sig)).error == "denied");
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(version_1_is_refused_and_told_so) {
    const auto signature_alone = [](const std::string& sig) { return sig.substr(0, sig.find('.')); };
    for (const std::string time : {"", ".", ".0", ".01", ".86400001", ".1.1", ".x"}) {
        const auto told = ask(second(signature_alone(signature(ask(first).challenge)) + time));
        BOOST_TEST(told.error == "denied", time);
        BOOST_TEST(told.challenge.empty(), time);
        BOOST_TEST(told.message == "car1 does not accept the signature for 'strike': it has not the form "
                                   "<signature>.<ms> of version 2: requester and executing node are upgraded together",
                   time);
    }
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(another_attempt_replaces_it) {
    const auto old = ask(first);
    const auto newer = ask(first);
    BOOST_TEST(old.challenge != newer.challenge);
    BOOST_TEST(node.secured().challenges().size() == 1U);
    BOOST_TEST(ask(second(signature(old.challenge))).error == "denied");
    const auto newest = ask(first);
    BOOST_TEST(ask(second(signature(newest.challenge))).error.empty());
}

// Another node may forward the second attempt than the first one.
BOOST_AUTO_TEST_CASE(the_second_attempt_may_come_on_another_link) {
    cles::test::test_link other{node, "car2"};
    cles::test::test_link of_another_member{node, "car3"};
    const auto given = ask(first);
    BOOST_TEST(read(of_another_member.ask(second(signature(given.challenge)))).error == "denied");
    BOOST_TEST(read(other.ask(second("x"))).error == "denied"); // does not use it up
    BOOST_TEST(runs == 0);
    BOOST_TEST(read(other.ask(second(signature(given.challenge)))).error.empty());
    BOOST_TEST(ask(second(signature(given.challenge))).error == "denied");
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(each_link_has_its_own_challenge_for_the_same_request) {
    cles::test::test_link other{node, "car2"};
    const auto here = ask(first);
    const auto there = read(other.ask(first));
    BOOST_TEST(read(other.ask(second(signature(here.challenge)))).error.empty());
    BOOST_TEST(ask(second(signature(there.challenge))).error.empty());
    BOOST_TEST(ask(second(signature(there.challenge))).error == "denied");
    BOOST_TEST(runs == 2);
}

BOOST_AUTO_TEST_CASE(it_is_forgotten_with_its_link) {
    cles::test::test_link other{node, "car2"};
    other.ask(first);
    BOOST_TEST(node.secured().challenges().size() == 1U);
    other.reset();
    BOOST_TEST(node.secured().challenges().size() == 0U);
}

BOOST_AUTO_TEST_CASE(it_belongs_to_the_stated_requester) {
    security->forwarders = {"car2"};
    const auto given = ask("DELEGATE car1:strike/now id=7 from=car3 {\"a\":1}");
    const auto sig = signature(given.challenge, "{\"a\":1}", "car3");
    BOOST_TEST(ask(second(sig)).error == "denied"); // as of car2
    BOOST_TEST(ask("DELEGATE car1:strike/now id=9 from=car3 sig=" + sig + " {\"a\":1}").error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(a_request_without_the_right_gets_no_challenge) {
    security->denied = {"car2 DELEGATE car1:strike/now"};
    const auto told = ask(first);
    BOOST_TEST(told.error == "denied");
    BOOST_TEST(told.challenge.empty());
}

BOOST_AUTO_TEST_CASE(a_link_has_a_limited_number) {
    const auto of = [](std::size_t i) { return "PULL car1:strike/" + std::to_string(i) + " id=7"; };
    constexpr auto most = cles::core::request_challenges::max_per_link;
    std::string oldest;
    for (std::size_t i = 0; i <= most; ++i) {
        const auto told = ask(of(i));
        oldest = i == 0 ? told.challenge : oldest;
    }
    BOOST_TEST(node.secured().challenges().size() == most);
    const auto sig = signature(oldest, "", "car2", verb::pull, "strike/0");
    BOOST_TEST(ask("PULL car1:strike/0 id=7 sig=" + sig).error == "denied");
}

BOOST_AUTO_TEST_CASE(so_has_the_node) {
    constexpr auto most = cles::core::request_challenges::max_in_all;
    constexpr auto each = cles::core::request_challenges::max_per_link;
    std::vector<std::unique_ptr<cles::test::test_link>> links;
    for (std::size_t i = 0; i <= most; ++i) {
        if (i % each == 0) {
            links.push_back(std::make_unique<cles::test::test_link>(node, "car3"));
        }
        links.back()->ask("PULL car1:strike/" + std::to_string(i) + " id=7");
    }
    BOOST_TEST(node.secured().challenges().size() == most);
    node.pass(6s);
    ask(first);
    BOOST_TEST(node.secured().challenges().size() == 1U); // the expired ones have gone
}

BOOST_AUTO_TEST_CASE(a_busy_node_does_not_use_it_up) {
    cles::limits bounds;
    bounds.running = 1;
    cles::test::test_node full{bounds, {}, {}, {}, security};
    full.host->tasks.add(verb::delegate, "strike",
                         {.info = {.must_be_signed = true},
                          .start = [this](const cles::request&, const std::shared_ptr<cles::core::call>& c) {
                              ++runs;
                              c->done("{}");
                          }});
    full.on_later(verb::delegate, "drive");
    cles::test::test_link to{full, "car2"};
    const auto given = read(to.ask(first));
    to.ask("DELEGATE car1:drive id=1");
    BOOST_TEST(read(to.ask(second(signature(given.challenge)))).error == "busy");
    full.started.front()->call->done("{}");
    full.started.clear();
    static_cast<void>(to.sent());
    BOOST_TEST(read(to.ask(second(signature(given.challenge)))).error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(a_node_without_security_refuses_them) {
    cles::test::test_node open;
    open.host->tasks.add(verb::delegate, "strike", entry());
    cles::test::test_link to{open};
    const auto told = read(to.ask(first));
    BOOST_TEST(told.error == "denied");
    BOOST_TEST(told.challenge.empty());
    BOOST_TEST(told.message == "car1: 'strike' requires signed requests, and this node has no security");
    BOOST_TEST(read(to.ask(second("x"))).error == "denied");
    BOOST_TEST(runs == 0);
}

BOOST_AUTO_TEST_CASE(they_are_described) {
    const auto told = link.ask("PULL self:cles id=7");
    BOOST_TEST(told.find(R"({"verb":"PULL","task":"strike","signed":true})") != std::string::npos, told);
}

BOOST_AUTO_TEST_SUITE(datagrams)

BOOST_AUTO_TEST_CASE(a_copy_gets_the_same_reply) {
    cles::test::test_link by{node, cles::protocol::datagram_bytes, "car2"};
    const std::string pull = "PULL car1:strike id=7";
    const auto given = by.ask(pull);
    BOOST_TEST(by.ask(pull) == given);
    const auto sig = signature(read(given).challenge, "", "car2", verb::pull, "strike");
    const auto repeated = "PULL car1:strike id=8 sig=" + sig;
    BOOST_TEST(by.ask(repeated) == "id=8 {}\n");
    BOOST_TEST(by.ask(repeated) == "id=8 {}\n");
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(routed)

BOOST_AUTO_TEST_CASE(a_signature_is_passed_on) {
    link.ask("DELEGATE sat1:strike id=7 sig=abc new=1 {\"a\": 1}");
    BOOST_TEST(ways.to("sat1").text == "DELEGATE sat1:strike hops=7 via=car1 from=car2 sig=abc new=1 {\"a\": 1}");
}

BOOST_AUTO_TEST_CASE(there_are_at_most_16_adverbs_with_it) {
    std::string foreign;
    for (char c = 'a'; c <= 'k'; ++c) {
        foreign += std::string{" x_"} + c + "=1";
    }
    link.ask("DELEGATE sat1:strike id=7 urgent=yes sig=abc" + foreign);
    const auto& text = ways.to("sat1").text;
    BOOST_TEST(text.find(" x_h=1") != std::string::npos, text);
    BOOST_TEST(text.find(" x_i=1") == std::string::npos, text); // id, deadline, progress, urgent may follow
}

BOOST_AUTO_TEST_CASE(a_challenge_is_passed_on_unchanged) {
    const std::string denied = R"({"error":"denied","message":"no","node":"sat1","challenge":"c","more":[1]})";
    link.ask("DELEGATE sat1:strike id=7");
    ways.to("sat1").refuses(denied);
    BOOST_TEST(link.take() == "id=7 " + denied + "\n");
}

BOOST_AUTO_TEST_CASE(any_does_not_go_to_another_node) {
    offer("sat1", task("DELEGATE", "aim", true));
    offer("car3", task("DELEGATE", "aim", true));
    link.ask("DELEGATE any:aim id=7");
    const auto asked = ways.to("sat1").open() ? "sat1" : "car3";
    const auto count = ways.count();
    const auto denied = R"({"error":"denied","message":"no","node":")" + std::string{asked} + R"(","challenge":"c"})";
    ways.to(asked).refuses(denied);
    BOOST_TEST(link.take() == "id=7 " + denied + "\n");
    BOOST_TEST(ways.count() == count);
}

BOOST_AUTO_TEST_CASE(this_node_as_one_of_any_asks_for_a_signature) {
    const auto told = ask("DELEGATE any:strike/now id=7 {\"a\":1}");
    BOOST_TEST(told.node == "car1");
    BOOST_TEST(ask(second(signature(told.challenge))).error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(so_does_one_that_answers_later) {
    node.host->tasks.add(verb::delegate, "aim",
                         {.info = {.must_be_signed = true},
                          .start = [this](const cles::request&, const std::shared_ptr<cles::core::call>& c) {
                              ++runs;
                              c->done("{}");
                          }});
    const auto told = ask("DELEGATE any:aim id=7");
    BOOST_TEST(told.node == "car1");
    const auto sig = signature(told.challenge, "", "car2", verb::delegate, "aim");
    BOOST_TEST(ask("DELEGATE car1:aim id=8 sig=" + sig).error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_CASE(so_does_this_node_as_one_of_all) {
    const auto told = link.ask("DELEGATE all:strike/now id=7 {\"a\":1}");
    BOOST_TEST(told.find(R"("errors":{"car1":{"error":"denied")") != std::string::npos, told);
    BOOST_TEST(ask(second(signature("challenge1"))).error.empty());
    BOOST_TEST(runs == 1);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
