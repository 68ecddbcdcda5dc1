// SPDX-License-Identifier: BSL-1.0
// Jobs that send requests while they serve one.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace responder {
namespace {

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

// The user sends a request to the car, whose job sends one to the tower.
struct nodes {
    nodes() {
        tower->on_delegate("plan", [this](const cles::request& asked, const cles::responder& answer) {
            plans.push_back({asked.deadline() - cles::time_point::clock::now(), answer});
            answer.on_stop([this] { ++plans_stopped; });
        });
        tower->on_pull("wind", [] { return 7; });
        car->on_delegate("job", [this](const cles::request&, const cles::responder& answer) {
            job = answer;
            begin(answer);
        });
    }
    void ask(const std::string& command = "DELEGATE car:job") {
        user->async_request(command, user_answer.options().on_progress([this](double part, std::string_view) {
            parts.push_back(part);
        }),
                            user_answer.take());
    }
    template <class F>
    void until(F f) {
        run_until(io, std::move(f));
    }
    // What was reported to the job.
    cles::answer_callback heard() {
        return [this](boost::system::error_code code, std::string_view json, std::string_view words) {
            ++answers;
            heard_code = code;
            heard_json = json;
            heard_words = words;
        };
    }

    struct plan {
        std::chrono::nanoseconds left;
        cles::responder answer;
    };
    boost::asio::io_context io;
    std::unique_ptr<cles::service> tower = std::make_unique<cles::service>(io, listening("tower"));
    std::unique_ptr<cles::service> car = std::make_unique<cles::service>(io, [this] {
        auto options = listening("car");
        options.peers.emplace("tower", tower->endpoints().front());
        return options;
    }());
    std::unique_ptr<cles::service> user = std::make_unique<cles::service>(io, knowing("user", *car));

    std::function<void(const cles::responder&)> begin = [](const cles::responder&) {};
    std::optional<cles::responder> job;
    std::vector<plan> plans;
    int plans_stopped = 0;
    answer<> user_answer;
    std::vector<double> parts;
    int answers = 0;
    boost::system::error_code heard_code;
    std::string heard_json;
    std::string heard_words;
};

} // namespace
} // namespace responder

BOOST_FIXTURE_TEST_SUITE(responder, nodes)

BOOST_AUTO_TEST_CASE(a_job_asks_another_node_and_replies_with_the_result) {
    begin = [](const cles::responder& answer) {
        answer.delegate("PULL tower:wind", [answer](auto code, std::string_view json, std::string_view) {
            BOOST_TEST(!code);
            answer.done(cles::json_text{std::string{json}});
        });
    };
    ask();
    until([&] { return user_answer.done(); });
    BOOST_TEST(user_answer.value.text == R"({"value":7})");
}

BOOST_AUTO_TEST_CASE(a_command_of_several_lines_is_one_request) {
    tower->on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
    begin = [this](const cles::responder& answer) {
        answer.delegate("PUSH tower:echo {\n  \"a\": [1,\n2]\n}", heard());
    };
    ask();
    until([&] { return answers == 1; });
    BOOST_TEST(heard_words == "");
    BOOST_TEST(heard_json == R"({"a":[1,2]})");
}

BOOST_AUTO_TEST_CASE(what_it_asks_has_no_longer_than_itself_or_less_where_it_says_so) {
    begin = [this](const cles::responder& answer) {
        answer.delegate("DELEGATE tower:plan", heard());
        answer.delegate("DELEGATE tower:plan", cles::call_options{}.deadline(1h), heard());
        answer.delegate("DELEGATE tower:plan", cles::call_options{}.deadline(3s), heard());
        answer.delegate("DELEGATE tower:plan deadline=2000", heard());
    };
    ask("DELEGATE car:job deadline=9000");
    until([&] { return plans.size() == 4; });
    const std::vector<std::chrono::nanoseconds> most{9s, 9s, 3s, 2s};
    for (std::size_t i = 0; i < most.size(); ++i) {
        BOOST_TEST(plans[i].left.count() <= most[i].count());
        BOOST_TEST(plans[i].left.count() > 0);
    }
}

BOOST_AUTO_TEST_CASE(what_it_asked_is_withdrawn_when_it_is_itself) {
    int told_before = 0;
    begin = [&](const cles::responder& answer) {
        answer.on_stop([&] { ++told_before; });
        answer.delegate("DELEGATE tower:plan", heard());
        answer.delegate("DELEGATE tower:plan", heard());
    };
    boost::asio::cancellation_signal withdraw;
    user->async_request("DELEGATE car:job", user_answer.options(),
                        boost::asio::bind_cancellation_slot(withdraw.slot(), user_answer.take()));
    until([&] { return plans.size() == 2; });
    withdraw.emit(boost::asio::cancellation_type::terminal);
    until([&] { return plans_stopped == 2 && answers == 2; });
    BOOST_TEST(heard_code == cles::make_error_code(errc::cancelled));
    BOOST_TEST(told_before == 1);
    // Afterwards it may not send any more requests.
    job->delegate("PULL tower:wind", heard());
    BOOST_TEST(answers == 2); // reported later, never inside the call
    until([&] { return answers == 3; });
    BOOST_TEST(heard_code == cles::make_error_code(errc::cancelled));
}

BOOST_AUTO_TEST_CASE(a_wish_to_be_told_of_the_end_may_come_after_the_first_question) {
    int told = 0;
    begin = [&](const cles::responder& answer) {
        answer.delegate("DELEGATE tower:plan", heard());
        answer.on_stop([] { BOOST_ERROR("the last one counts"); });
        answer.on_stop([&] { ++told; });
    };
    ask("DELEGATE car:job deadline=50");
    until([&] { return user_answer.done() && told == 1 && answers == 1; });
    BOOST_TEST(user_answer.code == cles::make_error_code(errc::deadline));
    int at_once = 0;
    job->on_stop([&] { ++at_once; });
    BOOST_TEST(at_once == 1);
    BOOST_TEST(told == 1);
}

BOOST_AUTO_TEST_CASE(a_job_that_ended_with_a_question_open_is_not_spoken_for) {
    begin = [this](const cles::responder& answer) {
        answer.delegate("DELEGATE tower:plan", heard());
        answer.done(1);
        job.reset();
    };
    ask();
    until([&] { return user_answer.done() && plans.size() == 1; });
    plans.front().answer.done(2);
    until([&] { return answers == 1; });
    BOOST_TEST(heard_json == R"({"value":2})");
    BOOST_TEST(user_answer.value.text == R"({"value":1})");
}

BOOST_AUTO_TEST_CASE(what_its_callback_throws_is_its_answer) {
    begin = [](const cles::responder& answer) {
        answer.delegate("PULL tower:wind", [answer](auto, std::string_view, std::string_view) {
            throw cles::error(errc::busy, "too windy");
        });
    };
    ask();
    until([&] { return user_answer.done(); });
    BOOST_TEST(user_answer.code == cles::make_error_code(errc::busy));
    BOOST_TEST(user_answer.words == "car: too windy");
}

BOOST_AUTO_TEST_CASE(it_receives_the_peers_message_and_errors_of_invalid_requests) {
    std::vector<std::string> all;
    begin = [&](const cles::responder& answer) {
        for (const auto* command : {"PULL tower:rain", "PULL nobody:wind", "BIND tower:wind", "nonsense"}) {
            answer.delegate(command,
                            [&](boost::system::error_code code, std::string_view json, std::string_view words) {
                                BOOST_TEST(json == "{}");
                                all.push_back(code.message() + ": " + std::string{words});
                            });
        }
    };
    ask();
    until([&] { return all.size() == 4; });
    const auto one_says = [&](const std::string& part) {
        return std::any_of(all.begin(), all.end(), [&](const auto& s) { return s.find(part) != std::string::npos; });
    };
    BOOST_TEST(one_says("tower has no PULL 'rain'"));
    BOOST_TEST(one_says("nobody"));
    BOOST_TEST(one_says("async_bind"));
}

BOOST_AUTO_TEST_CASE(progress_passes_through_it) {
    begin = [](const cles::responder& answer) {
        auto options = cles::call_options{};
        options.on_progress([answer](double part, std::string_view) { answer.progress(part / 2); });
        answer.delegate("DELEGATE tower:plan", options,
                        [answer](auto, std::string_view, std::string_view) { answer.done(); });
    };
    ask();
    until([&] { return plans.size() == 1; });
    plans.front().answer.progress(0.5);
    until([&] { return parts.size() == 1; });
    BOOST_TEST(parts.front() == 0.25);
    plans.front().answer.done();
    until([&] { return user_answer.done(); });
}

BOOST_AUTO_TEST_CASE(destroying_a_service_ends_the_requests_of_its_jobs) {
    begin = [this](const cles::responder& answer) { answer.delegate("DELEGATE tower:plan", heard()); };
    ask();
    until([&] { return plans.size() == 1; });
    car.reset();
    until([&] { return answers == 1; });
    job->delegate("PULL tower:wind", heard());
    BOOST_TEST(answers == 1); // as above
    until([&] { return answers == 2; });
    BOOST_TEST(heard_code == cles::make_error_code(errc::stopped));
    job.reset();
}

BOOST_AUTO_TEST_CASE(its_log_is_the_services) {
    std::vector<std::string> said;
    cles::service talker{io, {.name = "talker", .log = [&](cles::log_level level, std::string_view text) {
                                  if (level == cles::log_level::warning) {
                                      said.emplace_back(text);
                                  }
                              }}};
    talker.on_delegate("talk", [](const cles::request&, const cles::responder& answer) {
        answer.log(cles::log_level::warning, "half way");
        answer.done();
    });
    talker.request("DELEGATE self:talk");
    BOOST_TEST(said == (std::vector<std::string>{"half way"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
