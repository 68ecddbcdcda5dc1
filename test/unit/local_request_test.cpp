// SPDX-License-Identifier: BSL-1.0
#include "core/local_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(local_request)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

namespace {

struct log final : cles::core::leg_events {
    void on_result(std::size_t, std::string_view json) override { lines.push_back("ok " + std::string{json}); }
    void on_failure(std::size_t, cles::core::leg_failure why) override {
        lines.push_back(std::string{wire_name(why.told.code)} + (why.begun ? " begun: " : ": ") + why.told.message);
    }
    void on_progress(std::size_t, double fraction, std::string_view json) override {
        lines.push_back(std::to_string(static_cast<int>(fraction * 100)) + " % " + std::string{json});
    }
    std::vector<std::string> lines;
};

struct fixture {
    std::string run(const std::string& line) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request wrong;
        BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why);
        errand->lines.clear();
        one = std::make_unique<cles::core::local_request>(node.host, errand, 0);
        one->run(r, peer, node.clock.now() + 1s, node.clock.now());
        return last();
    }
    [[nodiscard]] std::string last() const { return errand->lines.empty() ? "" : errand->lines.back(); }

    cles::test::test_node node;
    cles::identity peer;
    std::shared_ptr<log> errand = std::make_shared<log>();
    std::unique_ptr<cles::core::local_request> one;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_plain_handler_answers_at_once, fixture) {
    node.on(verb::pull, "speed", [](const cles::request& r, cles::json_writer& w) { w.value(r.parameter(0)); });
    BOOST_TEST(run("PULL any:speed/a%20b") == "ok {\"value\":\"a b\"}");
}

BOOST_FIXTURE_TEST_CASE(a_later_answer_is_told_and_how_far_it_is, fixture) {
    node.on_later(verb::delegate, "work");
    BOOST_TEST(run("DELEGATE any:work progress=yes [1]").empty());
    auto& call = *node.started.at(0)->call;
    BOOST_TEST(node.started.at(0)->body == "[1]");
    BOOST_TEST(call.progress(0.5, {}));
    BOOST_TEST(last() == "50 % {}");
    call.done("2");
    BOOST_TEST(last() == "ok {\"value\":2}");
    call.done("3");
    BOOST_TEST(last() == "ok {\"value\":2}");
}

BOOST_FIXTURE_TEST_CASE(what_a_handler_throws_is_its_failure, fixture) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::denied, "never"); });
    BOOST_TEST(run("PULL any:speed") == "denied begun: car1: never");
}

BOOST_FIXTURE_TEST_CASE(a_busy_at_once_is_a_refusal_as_a_later_one_is, fixture) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::busy, "later"); });
    BOOST_TEST(run("PULL any:speed") == "busy: car1: later");
}

BOOST_FIXTURE_TEST_CASE(as_many_handlers_run_as_may, fixture) {
    cles::test::test_node full{{.running = 1}};
    full.on_later(verb::delegate, "work");
    cles::test::test_link link{full};
    link.ask("DELEGATE self:work id=1");
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE(cles::protocol::parse_request("DELEGATE any:work", r, wrong));
    cles::core::local_request second{full.host, errand, 0};
    second.run(r, peer, full.clock.now() + 1s, full.clock.now());
    BOOST_TEST(last() == "busy: car1 runs as many handlers as it may");
    BOOST_TEST(link.reply("DELEGATE self:work id=2").message == "car1 runs as many handlers as it may");
}

BOOST_FIXTURE_TEST_CASE(a_later_busy_is_a_refusal, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    node.started.at(0)->call->fail({.code = errc::busy, .message = "full"});
    BOOST_TEST(last() == "busy: car1: full");
}

BOOST_FIXTURE_TEST_CASE(a_result_that_looks_like_a_failure_is_one, fixture) {
    node.on(verb::pull, "speed", "{\"error\":1}");
    BOOST_TEST(run("PULL any:speed").starts_with("failed begun: "));
}

BOOST_FIXTURE_TEST_CASE(what_is_not_offered_is_no_task, fixture) {
    BOOST_TEST(run("PULL any:speed") == "no_task: car1 has no PULL 'speed'");
}

BOOST_FIXTURE_TEST_CASE(its_time_runs_out, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    node.pass(1s);
    BOOST_TEST(last().starts_with("deadline begun: "));
    BOOST_TEST(node.started.at(0)->stopped);
}

BOOST_FIXTURE_TEST_CASE(withdrawn_it_tells_the_handler_and_nobody_else, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    one->withdraw();
    BOOST_TEST(node.started.at(0)->stopped);
    node.started.at(0)->call->done("1");
    BOOST_TEST(errand->lines.empty());
    one.reset();
    node.started.clear();
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_request_to_publish_is_published_when_its_handler_has_run, fixture) {
    node.on(verb::update, "note", std::string{});
    BOOST_TEST(run("UPDATE any:note/a { \"x\" : 1 }") == "ok {}");
    BOOST_REQUIRE(node.host->published.find("note/a") != nullptr);
    BOOST_TEST(node.host->published.find("note/a")->last_body() == "{\"x\":1}");
}

BOOST_FIXTURE_TEST_CASE(the_reserved_task_tells_who_this_is, fixture) {
    BOOST_TEST(run("PULL all:cles").starts_with("ok {\"node\":\"car1\""));
}

BOOST_AUTO_TEST_SUITE_END()
