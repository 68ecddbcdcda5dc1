// SPDX-License-Identifier: BSL-1.0
#include "node/base/memory_budget.hpp"
#include "node/routing/subrequest.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

BOOST_AUTO_TEST_SUITE(local_request)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

namespace {

struct log {
    [[nodiscard]] cles::core::subrequest_outcome outcome() {
        return [this](std::string_view json, const cles::core::subrequest_failure* why) {
            if (why == nullptr) {
                lines.push_back("ok " + std::string{json});
                return;
            }
            lines.push_back(std::string{wire_name(why->reported.code)} + (why->reported.ran ? " ran" : "") +
                            (why->may_have_started ? " begun: " : ": ") + why->reported.message);
        };
    }
    [[nodiscard]] cles::core::outbound::progress_function progress() {
        return [this](double fraction, std::string_view json) {
            lines.push_back(std::to_string(static_cast<int>(fraction * 100)) + " % " + std::string{json});
        };
    }
    std::vector<std::string> lines;
};

struct fixture {
    std::string run(const std::string& line) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request wrong;
        BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why);
        reported.lines.clear();
        one = std::make_unique<cles::core::local_request>(node.host, reported.outcome(), account, reported.progress());
        one->run(r, peer, node.clock.now() + 1s, node.clock.now());
        return last();
    }
    [[nodiscard]] std::string last() const { return reported.lines.empty() ? "" : reported.lines.back(); }

    cles::test::test_node node{cles::limits{.nouns = 1, .memory = 10'000}};
    std::shared_ptr<cles::core::memory_account> account =
        std::make_shared<cles::core::memory_account>(node.host->memory);
    cles::identity peer;
    log reported;
    std::unique_ptr<cles::core::local_request> one;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(plain_handler_replies_at_once, fixture) {
    node.on(verb::pull, "speed", [](const cles::request& r, cles::json_writer& w) { w.value(r.parameter(0)); });
    BOOST_TEST(run("PULL any:speed/a%20b") == "ok {\"value\":\"a b\"}");
}

BOOST_FIXTURE_TEST_CASE(later_reply_and_progress_are_reported, fixture) {
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

BOOST_FIXTURE_TEST_CASE(exception_of_a_handler_is_its_failure, fixture) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::denied, "never"); });
    BOOST_TEST(run("PULL any:speed") == "denied begun: car1: never");
}

BOOST_FIXTURE_TEST_CASE(immediate_busy_is_a_refusal_like_a_later_one, fixture) {
    node.on(verb::pull, "speed",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::busy, "later"); });
    BOOST_TEST(run("PULL any:speed") == "busy: car1: later");
}

BOOST_FIXTURE_TEST_CASE(number_of_running_handlers_is_bounded, fixture) {
    cles::test::test_node full{{.running = 1}};
    full.on_later(verb::delegate, "work");
    cles::test::test_link link{full};
    link.ask("DELEGATE self:work id=1");
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE(cles::protocol::parse_request("DELEGATE any:work", r, wrong));
    cles::core::local_request second{full.host, reported.outcome()};
    second.run(r, peer, full.clock.now() + 1s, full.clock.now());
    BOOST_TEST(last() == "busy: car1 has reached its limit of running handlers");
    BOOST_TEST(link.reply("DELEGATE self:work id=2").message == "car1 has reached its limit of running handlers");
}

BOOST_FIXTURE_TEST_CASE(later_busy_is_a_refusal, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    node.started.at(0)->call->fail({.code = errc::busy, .message = "full"});
    BOOST_TEST(last() == "busy: car1: full");
}

BOOST_FIXTURE_TEST_CASE(result_that_looks_like_a_failure_is_one, fixture) {
    node.on(verb::pull, "speed", "{\"error\":1}");
    BOOST_TEST(run("PULL any:speed").starts_with("failed begun: "));
}

BOOST_FIXTURE_TEST_CASE(no_task_if_not_offered, fixture) {
    BOOST_TEST(run("PULL any:speed") == "no_task: car1 has no PULL 'speed'");
}

BOOST_FIXTURE_TEST_CASE(deadline_expires, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    node.pass(1s);
    BOOST_TEST(last().starts_with("deadline begun: "));
    BOOST_TEST(node.started.at(0)->stopped);
}

BOOST_FIXTURE_TEST_CASE(cancellation_notifies_only_the_handler, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    one->withdraw();
    BOOST_TEST(node.started.at(0)->stopped);
    node.started.at(0)->call->done("1");
    BOOST_TEST(reported.lines.empty());
    one.reset();
    node.started.clear();
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_FIXTURE_TEST_CASE(update_request_is_published_after_its_handler, fixture) {
    node.on(verb::update, "note", std::string{});
    BOOST_TEST(run("UPDATE any:note/a { \"x\" : 1 }") == "ok {}");
    BOOST_REQUIRE(node.host->published.find("note/a") != nullptr);
    BOOST_TEST(node.host->published.find("note/a")->last_body() == "{\"x\":1}");
}

BOOST_FIXTURE_TEST_CASE(too_large_says_that_the_handler_ran, fixture) {
    node.on(verb::pull, "map",
            [](const cles::request&, cles::json_writer&) { throw cles::error(errc::too_large, "too long"); });
    BOOST_TEST(run("PULL any:map") == "too_large ran begun: car1: too long");
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work");
    node.started.at(0)->call->fail({.code = errc::too_large, .message = "too long"});
    BOOST_TEST(last() == "too_large ran begun: car1: too long");
}

BOOST_FIXTURE_TEST_CASE(running_request_counts_until_its_handler_releases_it, fixture) {
    node.on_later(verb::delegate, "work");
    run("DELEGATE any:work [\"" + std::string(2'000, 'x') + "\"]");
    BOOST_TEST(account->used() > 2'000U);
    one->withdraw();
    BOOST_TEST(account->used() > 2'000U);
    one.reset();
    node.started.clear();
    BOOST_TEST(account->used() == 0U);
}

BOOST_FIXTURE_TEST_CASE(without_memory_no_handler_starts, fixture) {
    node.on(verb::pull, "speed", "1");
    node.on_later(verb::delegate, "work");
    BOOST_TEST(run("DELEGATE any:work [\"" + std::string(9'000, 'x') + "\"]").starts_with("busy: car1"));
    BOOST_TEST(node.started.empty());
    BOOST_TEST(account->used() == 0U);
    cles::core::memory_reservation all{account};
    all.resize(10'000);
    BOOST_TEST(run("PULL any:speed").starts_with("busy: car1"));
    BOOST_TEST(run("PULL any:cles").starts_with("ok {\"node\":\"car1\""));
}

BOOST_FIXTURE_TEST_CASE(update_that_cannot_be_published_after_its_handler_says_that_it_ran, fixture) {
    node.on_later(verb::update, "note");
    run("UPDATE any:note/a [1]");
    cles::test::test_link subscriber{node};
    subscriber.ask("BIND car1:note/b"); // now the task has reached its limit of nouns
    node.started.at(0)->call->done("");
    BOOST_TEST(last().starts_with("busy ran begun: car1: "));
}

BOOST_FIXTURE_TEST_CASE(reserved_task_returns_the_identity, fixture) {
    BOOST_TEST(run("PULL all:cles").starts_with("ok {\"node\":\"car1\""));
}

BOOST_AUTO_TEST_SUITE_END()
