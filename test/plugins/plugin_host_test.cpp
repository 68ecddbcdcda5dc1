// SPDX-License-Identifier: BSL-1.0
// What plugins may do, and what they must not do, with a service that calls them inline.
#include <cles/service.hpp>

#include "plugins/plugin_host.hpp"
#include "support/answer.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace plugin_host {
namespace {

using cles::errc;
using cles::runtime::plugin_host;
using namespace cles::test;
using namespace std::chrono_literals;

struct fixture {
    explicit fixture(const std::string& plugin = "sound.so", const std::string& config = "{}") {
        host.emplace(cles::runtime::plugin_host_options{
            .node = "node",
            .rules = {.folders = {MADE_PLUGINS}},
            .log =
                [this](cles::log_level, std::string_view who, std::string_view text) {
                    const std::scoped_lock lock{mutex};
                    said.push_back(std::string{who} + ": " + std::string{text});
                },
            .trial = 0ms});
        host->load(plugin, config, node);
    }
    bool was_said(const std::string& part) {
        const std::scoped_lock lock{mutex};
        return std::any_of(said.begin(), said.end(),
                           [&](const std::string& line) { return line.find(part) != std::string::npos; });
    }

    std::string ask(const std::string& command) {
        try {
            return node.request(command);
        } catch (const cles::error& e) {
            return e.what();
        }
    }
    // Sends it, and does not wait.
    answer<>& send(const std::string& command) {
        auto& a = answers.emplace_back();
        node.async_request(command, a.options(), a.take());
        run_ready(io);
        return a;
    }
    void wait_for(const answer<>& a) {
        run_until(io, [&] { return a.done(); });
    }

    std::mutex mutex;
    std::vector<std::string> said;
    std::list<answer<>> answers;
    boost::asio::io_context io;
    cles::service node{io, {.name = "node", .log = [this](cles::log_level, std::string_view text) {
                                const std::scoped_lock lock{mutex};
                                said.emplace_back(text);
                            }}};
    std::optional<plugin_host> host;
};

struct rough : fixture {
    rough() : fixture("rough.so") {}
};

} // namespace
} // namespace plugin_host

BOOST_FIXTURE_TEST_SUITE(plugin_host, fixture)

BOOST_AUTO_TEST_CASE(it_tells_what_is_loaded) {
    const auto& loaded = host->plugins().at(0);
    BOOST_TEST(loaded.path == "sound.so");
    BOOST_TEST(loaded.name == "sound");
    BOOST_TEST(loaded.version == "2.1");
    BOOST_TEST(loaded.tasks.at(0) == "PULL number");
    const auto described = ask("PULL self:cles");
    BOOST_TEST(described.find(R"({"verb":"PULL","task":"number","description":"A number","idempotent":true})") !=
               std::string::npos);
    BOOST_TEST(described.find(R"({"verb":"PUSH","task":"guarded","signed":true})") != std::string::npos);
    BOOST_TEST(described.find(R"("task":"parameters","parameters":["text"])") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(handlers_of_all_shapes_answer_as_in_an_application) {
    BOOST_TEST(ask("PULL self:number") == R"({"value":42})");
    BOOST_TEST(ask("PULL self:parameters/a%20b") == R"({"value":3})");
    BOOST_TEST(ask("PULL self:parameters") == "bad_request: node: parameter 1 is missing");
    BOOST_TEST(ask(R"(PUSH self:sum {"a":1.5,"b":2})") == R"({"value":3.5})");
    BOOST_TEST(ask(R"(PUSH self:sum {"a":1.5})").starts_with("bad_request: node: the body is invalid: b"));
    BOOST_TEST(ask("PUSH self:fails") == "denied: node: not you");
    BOOST_TEST(ask("PUSH self:guarded") ==
               "denied: node: 'guarded' requires signed requests, and this node has no security");
    BOOST_TEST(ask(R"(UPDATE self:target {"x":1})") == "{}");
    BOOST_TEST(host->figures().jobs == 0U);
    BOOST_TEST(host->figures().answered_twice == 0U);
}

BOOST_AUTO_TEST_CASE(its_settings_reach_it) {
    fixture f{"sound.so", R"({"number":7})"};
    BOOST_TEST(f.ask("PULL self:number") == R"({"value":7})");
}

BOOST_AUTO_TEST_CASE(a_job_answers_from_another_thread_with_progress_and_log) {
    std::vector<double> parts;
    auto& a = answers.emplace_back();
    node.async_request(R"(DELEGATE self:elsewhere {"a":1,"b":2})",
                       a.options().on_progress([&](double part, std::string_view) { parts.push_back(part); }),
                       a.take());
    wait_for(a);
    BOOST_TEST(a.value.text == R"({"a":1,"b":2})");
    BOOST_TEST(parts == (std::vector<double>{0.25, 0.5}), boost::test_tools::per_element());
    BOOST_TEST(was_said("sound: half way"));
}

BOOST_AUTO_TEST_CASE(a_job_whose_responders_go_without_an_answer_has_failed) {
    BOOST_TEST(ask("DELEGATE self:dropped") == "failed: node: the handler ended without an answer");
    BOOST_TEST(ask("DELEGATE self:dropped_elsewhere") == "failed: node: the handler ended without an answer");
    BOOST_TEST(host->figures().jobs == 0U);
}

BOOST_AUTO_TEST_CASE(a_job_is_notified_when_its_time_is_over) {
    BOOST_TEST(ask("DELEGATE self:until_stopped deadline=20").starts_with("deadline: "));
    BOOST_TEST(ask("DELEGATE self:polls deadline=20").starts_with("deadline: "));
    run_until(io, [&] { return host->figures().jobs == 0; }); // both have completed
    BOOST_TEST(host->figures().answered_twice == 0U);
}

BOOST_AUTO_TEST_CASE(a_job_asks_others_and_continues_with_the_reply) {
    BOOST_TEST(ask("DELEGATE self:asks/pull") == R"({"value":42})");
    BOOST_TEST(ask("DELEGATE self:asks/nobody") == "no_task: node has no DELEGATE 'nobody'");
    BOOST_TEST(ask("DELEGATE self:asks_and_throws") == "failed: node: did not like it");
}

BOOST_AUTO_TEST_CASE(a_job_asks_from_another_thread_and_receives_progress) {
    std::vector<double> parts;
    auto& a = answers.emplace_back();
    node.async_request("DELEGATE self:asks_elsewhere",
                       a.options().on_progress([&](double part, std::string_view) { parts.push_back(part); }),
                       a.take());
    wait_for(a);
    BOOST_TEST(a.value.text == R"({"a":1,"b":2})");
    BOOST_TEST(parts == (std::vector<double>{0.125, 0.25}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(its_bind_handler_decides_and_what_it_publishes_arrives) {
    using json_feed = cles::feed<cles::json_text>;
    std::optional<std::string> got;
    std::shared_ptr<json_feed> kept;
    std::function<void()> next = [&] {
        kept->async_next([&](boost::system::error_code code, const auto& event) {
            BOOST_REQUIRE(!code);
            if (event.kind == cles::feed_event::update) {
                got = event.value.text;
            } else {
                next();
            }
        });
    };
    node.async_bind("self:ticks", [&](boost::system::error_code code, json_feed feed) {
        BOOST_REQUIRE(!code);
        kept = std::make_shared<json_feed>(std::move(feed));
        next();
    });
    run_until(io, [&] { return got.has_value(); });
    BOOST_TEST(*got == R"({"value":1})");
    std::string words;
    bool over = false;
    node.async_bind("self:ticks/fast", cles::bind_options{}.diagnostics(words),
                    [&](boost::system::error_code code, const cles::feed<cles::json_text>&) {
                        BOOST_TEST(code == cles::make_error_code(errc::bad_request));
                        over = true;
                    });
    run_until(io, [&] { return over; });
    BOOST_TEST(words == "node: ticks have no parameters");
}

BOOST_AUTO_TEST_CASE(at_the_stop_jobs_are_completed_and_notified_and_no_further_one_starts) {
    auto& told = send("DELEGATE self:until_stopped");
    auto& polls = send("DELEGATE self:polls");
    BOOST_TEST(host->stop(20s).late.empty());
    wait_for(told);
    wait_for(polls);
    BOOST_TEST(told.code == cles::make_error_code(errc::unavailable));
    BOOST_TEST(told.words == "node has stopped");
    BOOST_TEST(polls.code == cles::make_error_code(errc::unavailable));
    BOOST_TEST(ask("PULL self:number") == "unavailable: node: the plugin 'sound' has stopped");
    BOOST_TEST(ask("BIND self:ticks").find("async_bind") != std::string::npos);
    BOOST_TEST(host->stop(20s).late.empty()); // once is sufficient
}

BOOST_FIXTURE_TEST_CASE(a_job_is_answered_once_however_often_its_plugin_tries, rough) {
    BOOST_TEST(ask("DELEGATE self:twice") == R"({"value":1})");
    BOOST_TEST(ask("DELEGATE self:twice_elsewhere") == R"({"value":1})");
    BOOST_TEST(host->figures().answered_twice == 4U);
    BOOST_TEST(was_said("answered a job that does not exist or has been answered"));
    BOOST_TEST(host->figures().jobs == 0U);
}

BOOST_FIXTURE_TEST_CASE(invalid_handles_are_harmless, rough) {
    BOOST_TEST(ask("DELEGATE self:invented") == R"({"value":true})");
    BOOST_TEST(was_said("rough: of no job"));
}

BOOST_FIXTURE_TEST_CASE(exceptions_from_a_handler_are_caught_and_reported, rough) {
    BOOST_TEST(ask("DELEGATE self:throws") == "failed: node: the handler failed");
    BOOST_TEST(was_said("rough: throws: its handler threw 'out of the plugin' out of the plugin"));
    BOOST_TEST(ask("DELEGATE self:throws_anything") == "failed: node: the handler failed");
    BOOST_TEST(host->figures().jobs == 0U);
}

BOOST_FIXTURE_TEST_CASE(what_is_no_json_is_not_passed_on, rough) {
    BOOST_TEST(ask("DELEGATE self:no_json") == "failed: node: the plugin's answer is not JSON");
    BOOST_TEST(ask("DELEGATE self:unknown_code") == "failed: node: as it does");
    BOOST_TEST(ask("DELEGATE self:bad_progress") == "{}");
    run_ready(io);
    BOOST_TEST(was_said("an update of 'fine' is not valid JSON"));
    BOOST_TEST(was_said("was refused"));
}

BOOST_FIXTURE_TEST_CASE(a_job_that_is_forgotten_ends_at_its_deadline, rough) {
    BOOST_TEST(ask("DELEGATE self:forgets deadline=20").starts_with("deadline: "));
    BOOST_TEST(host->figures().jobs == 1U); // its plugin may still reply
    BOOST_TEST(host->stop(20s).late.empty());
    BOOST_TEST(host->figures().jobs == 0U);
    BOOST_TEST(was_said("rough: its stop threw"));
}

// Even with a very short limit.
BOOST_FIXTURE_TEST_CASE(an_on_stop_callback_that_blocks_does_not_keep_its_plugin_from_stopping, rough) {
    send("DELEGATE self:blocks_when_stopped");
    const auto left = host->stop(200ms);
    BOOST_TEST(left.late.empty());
    BOOST_TEST(left.callbacks == 1U);
    BOOST_TEST(was_said("rough: its stop threw"));
}

BOOST_FIXTURE_TEST_CASE(a_request_reaches_it_as_it_came, rough) {
    BOOST_TEST(ask(R"(DELEGATE self:show/a/b%20c {"x":[1]})") ==
               R"({"task":"show","node":"node","parameters":["a","b c"],"body":{"x":[1]},"verb":2,"timely":true,)"
               R"("transport":"inproc","local":1})");
}

BOOST_FIXTURE_TEST_CASE(tasks_are_added_while_it_starts_alone, rough) {
    BOOST_TEST(ask("DELEGATE self:too_late") == R"({"value":true})");
    BOOST_TEST(was_said("rough: continues without a task: PULL 'idle' has no handler"));
}

BOOST_FIXTURE_TEST_CASE(a_bind_is_what_its_handler_makes_of_it, rough) {
    std::string words;
    bool over = false;
    node.async_bind("self:unwelcoming", cles::bind_options{}.diagnostics(words),
                    [&](boost::system::error_code, const cles::feed<cles::json_text>&) { over = true; });
    run_until(io, [&] { return over; });
    BOOST_TEST(words == "node: not you");
    BOOST_TEST(host->figures().jobs == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
