// SPDX-License-Identifier: BSL-1.0
// Requests from one service to another, over each transport.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/localization.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/error.hpp>
#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

BOOST_AUTO_TEST_SUITE(requests)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

constexpr std::array carriers{carrier::tcp4, carrier::tcp6, carrier::unix_file, carrier::unix_abstract,
                              carrier::inproc};

// Each link takes two levels of brackets.
struct chain {
    std::vector<chain> next{};
};
BOOST_DESCRIBE_STRUCT(chain, (), (next))

struct reading {
    double value = 0;
};
BOOST_DESCRIBE_STRUCT(reading, (), (value))
using reading_or_number = std::variant<reading, double>;

// Two services, one of which serves a task for every verb.
struct two_nodes {
    explicit two_nodes(carrier kind) : car(io, listening("car1", kind)), tower(io, knowing("tower", car)) {
        car.on_pull("localization", [] { return localization{1.5, 52.25, 13.125}; });
        car.on_pull("speed", [] { return 42; });
        car.on_pull("echo", [](const cles::request& r) {
            return std::vector<std::string>(r.parameters().begin(), r.parameters().end());
        });
        car.on_push("place", [this](const localization& where) { pushed = where; });
        car.on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
        car.on_delegate("drive", [this](const cles::request&, cles::responder r) { job.emplace(std::move(r)); });
        car.on_update("notice", [this](const cles::request& r) { noticed = r.body(); });
    }

    template <class T>
    void wait_for(const answer<T>& a) {
        run_until(io, [&] { return a.done(); });
    }

    boost::asio::io_context io;
    localization pushed;
    std::string noticed;
    std::optional<cles::responder> job;
    cles::service car;
    cles::service tower;
};

CLES_DATA_TEST_CASE(what_is_urgent_does_not_wait_behind_large_answers, carriers, kind) {
    two_nodes n{kind};
    n.car.on_pull("map", [] { return std::string(900'000, 'x'); });
    constexpr std::size_t count = 20;
    std::vector<answer<cles::json_text>> large(count);
    for (auto& each : large) {
        n.tower.async_pull("car1:map", cles::call_options{}.deadline(1min), each.take());
    }
    answer<int> small;
    n.tower.async_pull<int>("car1:speed", cles::call_options{}.urgent(), small.take());
    n.wait_for(small);
    BOOST_TEST(small.value == 42);
    BOOST_TEST(!large.back().done());
    n.wait_for(large.back());
    BOOST_TEST(large.back().value.text.size() > 900'000U);
}

CLES_DATA_TEST_CASE(a_command_whose_body_has_several_lines_is_sent_as_one, carriers, kind) {
    two_nodes n{kind};
    answer<> echoed;
    n.tower.async_request("PUSH car1:echo {\n  \"a\": [1,\r\n\t2],\n  \"b\": \"x\\n y\"\n}\n", echoed.take());
    n.wait_for(echoed);
    BOOST_TEST(!echoed.code);
    BOOST_TEST(echoed.value.text == R"({"a":[1,2],"b":"x\n y"})");
    answer<> counted;
    n.tower.async_request("PULL car1:cles/metrics", counted.take());
    n.wait_for(counted);
    BOOST_TEST(counted.value.text.find("\"errors\":0,") != std::string::npos, counted.value.text);
}

BOOST_AUTO_TEST_CASE(the_whole_failure_is_received_where_that_is_wanted) {
    two_nodes n{carrier::inproc};
    n.car.on_pull("later", [](const cles::request&, const cles::responder& to) { to.refuse("not now", 250ms); });
    std::string failure;
    answer<cles::json_text> asked;
    n.tower.async_pull("car1:later", cles::call_options{}.failure(failure), asked.take());
    n.wait_for(asked);
    BOOST_TEST((asked.code == errc::busy));
    BOOST_TEST(failure.starts_with(R"({"error":"busy")"), failure);
    BOOST_TEST(failure.find(R"("retry_ms":250)") != std::string::npos, failure);
}

// Both are {"value":5} as JSON, in every way in which a value is sent.
BOOST_AUTO_TEST_CASE(an_object_that_looks_like_a_scalar_is_received_as_what_it_was) {
    two_nodes n{carrier::inproc};
    const reading_or_number made = reading{5};
    n.car.on_pull("plain", [made] { return made; });
    n.car.on_pull("later", [made](const cles::request&, const cles::responder& to) { to.done(made); });
    n.car.on_pull("coroutine", [made]() -> boost::asio::awaitable<reading_or_number> { co_return made; });
    n.car.on_push("same", [](const reading_or_number& sent) { return sent; });
    for (const std::string task : {"plain", "later", "coroutine"}) {
        answer<reading_or_number> pulled;
        n.tower.async_pull<reading_or_number>("car1:" + task, pulled.take());
        n.wait_for(pulled);
        BOOST_TEST(!pulled.code, task);
        BOOST_TEST(pulled.value.index() == 0U, task);
    }
    for (const auto& sent : {made, reading_or_number{5.0}}) {
        answer<reading_or_number> same;
        n.tower.async_push<reading_or_number>("car1:same", sent, same.take());
        n.wait_for(same);
        BOOST_TEST(same.value.index() == sent.index());
    }

    n.car.update("either", made);
    answer<cles::feed<reading_or_number>> bound;
    n.tower.async_bind<reading_or_number>("car1:either", bound.take());
    n.wait_for(bound);
    const auto next_index = [&] {
        answer<cles::feed_item<reading_or_number>> next;
        bound.value.async_next(next.take());
        n.wait_for(next);
        return next.value.value.index();
    };
    BOOST_TEST(next_index() == 0U);
    answer<void> updated;
    n.car.async_update("either", made, updated.take());
    BOOST_TEST(next_index() == 0U);
    n.car.make_publisher().update("either", made);
    BOOST_TEST(next_index() == 0U);
    n.car.update("either", reading_or_number{5.0});
    BOOST_TEST(next_index() == 1U);
}

CLES_DATA_TEST_CASE(a_result_that_no_requester_would_read_fails_at_once, carriers, kind) {
    two_nodes n{kind};
    n.car.on_pull("chain", [](const cles::request& r) {
        chain made;
        for (auto left = r.parameter<int>(0); left > 1; --left) {
            made = chain{{std::move(made)}};
        }
        return made;
    });
    n.car.on_pull("later", [](const cles::request& r, const cles::responder& to) {
        chain made;
        for (auto left = r.parameter<int>(0); left > 1; --left) {
            made = chain{{std::move(made)}};
        }
        to.done(made);
    });
    for (const std::string task : {"chain", "later"}) {
        answer<> fits;
        n.tower.async_pull("car1:" + task + "/17", fits.take());
        n.wait_for(fits);
        BOOST_TEST(!fits.code, task);
        answer<> too_deep;
        n.tower.async_pull("car1:" + task + "/18", too_deep.options().deadline(1h), too_deep.take());
        n.wait_for(too_deep); // an hour before its deadline
        BOOST_TEST((too_deep.code == errc::failed), task);
        BOOST_TEST(too_deep.words == "car1: nested deeper than 35 levels", task);
    }
    chain body;
    for (int i = 0; i < 40; ++i) {
        body = chain{{std::move(body)}};
    }
    answer<> sent;
    n.tower.async_push("car1:echo", body, sent.options(), sent.take());
    n.wait_for(sent);
    BOOST_TEST((sent.code == errc::conversion));
    BOOST_TEST(sent.words == "nested deeper than 35 levels");
    BOOST_CHECK_EXCEPTION(n.car.update("state", body), cles::error,
                          [](const cles::error& e) { return e.code() == errc::conversion; });
}

CLES_DATA_TEST_CASE(pull_gives_data_typed_and_raw, carriers, kind) {
    two_nodes n{kind};
    answer<localization> typed;
    answer<> raw;
    answer<int> scalar;
    n.tower.async_pull<localization>("car1:localization", typed.take());
    n.tower.async_pull("car1:localization", raw.take());
    n.tower.async_pull<int>("car1:speed", scalar.take());
    run_until(n.io, [&] { return typed.done() && raw.done() && scalar.done(); });
    BOOST_TEST(!typed.code);
    BOOST_TEST((typed.value == localization{1.5, 52.25, 13.125}));
    BOOST_TEST(raw.value.text == R"({"utc":1.5,"lat":52.25,"lon":13.125})");
    BOOST_TEST(scalar.value == 42);
    BOOST_TEST(typed.calls == 1);
}

CLES_DATA_TEST_CASE(parameters_cross_decoded, carriers, kind) {
    two_nodes n{kind};
    answer<std::vector<std::string>> echoed;
    n.tower.async_pull<std::vector<std::string>>("car1:echo/a%20b/%C3%A4/1.5", echoed.take());
    n.wait_for(echoed);
    BOOST_TEST((echoed.value == std::vector<std::string>{"a b", "\xC3\xA4", "1.5"}));
}

CLES_DATA_TEST_CASE(push_sends_data_typed_and_raw, carriers, kind) {
    two_nodes n{kind};
    answer<> typed;
    answer<> raw;
    n.tower.async_push("car1:place", localization{1, 2, 3}, typed.take());
    n.tower.async_push("car1:echo", cles::json_text{R"({ "a" : [1, 2] })"}, raw.take());
    run_until(n.io, [&] { return typed.done() && raw.done(); });
    BOOST_TEST(!typed.code);
    BOOST_TEST(typed.value.text == "{}");
    BOOST_TEST((n.pushed == localization{1, 2, 3}));
    BOOST_TEST(raw.value.text == R"({"a":[1,2]})");
}

CLES_DATA_TEST_CASE(delegate_reports_progress_and_gives_the_result, carriers, kind) {
    two_nodes n{kind};
    answer<> result;
    std::vector<std::pair<double, std::string>> reports;
    auto options = result.options().on_progress(
        [&](double fraction, std::string_view details) { reports.emplace_back(fraction, details); });
    n.tower.async_delegate("car1:drive", cles::json_text{}, options, result.take());
    run_until(n.io, [&] { return n.job.has_value(); });
    BOOST_TEST(n.job->progress(0.25));
    BOOST_TEST(n.job->progress(0.5, cles::json_text{R"({"at":"bridge"})"}));
    BOOST_TEST(n.job->progress(0.125)); // never decreases
    run_until(n.io, [&] { return reports.size() == 3; });
    BOOST_TEST(!result.done());
    n.job->done(localization{7, 8, 9});
    n.wait_for(result);
    BOOST_TEST(result.value.text == R"({"utc":7,"lat":8,"lon":9})");
    BOOST_TEST(reports[0].first == 0.25);
    BOOST_TEST(reports[1].first == 0.5);
    BOOST_TEST(reports[1].second == R"({"at":"bridge"})");
    BOOST_TEST(reports[2].first == 0.5);
}

CLES_DATA_TEST_CASE(update_asks_the_other_to_publish, carriers, kind) {
    two_nodes n{kind};
    answer<> asked;
    answer<> refused;
    n.tower.async_request(R"(UPDATE car1:notice {"text":"hi"})", asked.take());
    n.tower.async_request(R"(UPDATE car1:localization {})", refused.options(), refused.take());
    run_until(n.io, [&] { return asked.done() && refused.done(); });
    BOOST_TEST(!asked.code);
    BOOST_TEST(n.noticed == R"({"text":"hi"})");
    BOOST_TEST(refused.code == errc::no_task);
}

CLES_DATA_TEST_CASE(a_command_is_a_sentence_of_the_language, carriers, kind) {
    two_nodes n{kind};
    answer<> pulled;
    answer<> pushed;
    for (const std::string_view adverb : {"id=7", "reply=no", "progress=yes", "via=car2", "colour=red"}) {
        answer<> refused;
        n.tower.async_request("PUSH car1:echo " + std::string{adverb}, refused.options(), refused.take());
        run_until(n.io, [&] { return refused.done(); });
        BOOST_TEST(refused.code == errc::bad_request);
        BOOST_TEST(refused.words.find(adverb) != std::string::npos, refused.words);
    }
    n.tower.async_request("PULL car1:speed", pulled.take());
    n.tower.async_request(R"(push car1:echo {"x":"y"})", pushed.take());
    run_until(n.io, [&] { return pulled.done() && pushed.done(); });
    BOOST_TEST(pulled.value.text == R"({"value":42})");
    BOOST_TEST(pushed.value.text == R"({"x":"y"})");
}

CLES_DATA_TEST_CASE(many_requests_in_flight_are_each_answered_once, carriers, kind) {
    two_nodes n{kind};
    constexpr std::size_t count = 2000;
    std::vector<answer<std::vector<std::string>>> all(count);
    for (std::size_t i = 0; i < count; ++i) {
        n.tower.async_pull<std::vector<std::string>>("car1:echo/" + std::to_string(i), all[i].take());
    }
    run_until(n.io, [&] { return std::all_of(all.begin(), all.end(), [](const auto& a) { return a.done(); }); });
    for (std::size_t i = 0; i < count; ++i) {
        BOOST_REQUIRE(all[i].calls == 1);
        BOOST_REQUIRE(all[i].value.at(0) == std::to_string(i));
    }
}

CLES_DATA_TEST_CASE(failures_contain_the_peers_message, carriers, kind) {
    two_nodes n{kind};
    answer<> unknown_task;
    answer<> wrong_body;
    answer<localization> wrong_type;
    n.tower.async_pull("car1:altitude", unknown_task.options(), unknown_task.take());
    n.tower.async_push("car1:place", cles::json_text{R"({"utc":1,"lat":"north","lon":2})"}, wrong_body.options(),
                       wrong_body.take());
    n.tower.async_pull<localization>("car1:speed", wrong_type.options(), wrong_type.take());
    run_until(n.io, [&] { return unknown_task.done() && wrong_body.done() && wrong_type.done(); });
    BOOST_TEST(unknown_task.code == errc::no_task);
    BOOST_TEST(unknown_task.words == "car1 has no PULL 'altitude'");
    BOOST_TEST(wrong_body.code == errc::bad_request);
    BOOST_TEST(wrong_body.words.find("lat: expected a number") != std::string::npos, wrong_body.words);
    BOOST_TEST(wrong_type.code == errc::conversion);
    BOOST_TEST(wrong_type.words.find("utc") != std::string::npos, wrong_type.words);
}

CLES_DATA_TEST_CASE(a_deadline_ends_the_request_at_both_ends, carriers, kind) {
    two_nodes n{kind};
    answer<> late;
    bool stopped = false;
    n.tower.async_delegate("car1:drive", cles::json_text{}, late.options().deadline(60ms), late.take());
    run_until(n.io, [&] { return n.job.has_value(); });
    n.job->on_stop([&] { stopped = true; });
    n.wait_for(late);
    BOOST_TEST(late.code == errc::deadline);
    run_until(n.io, [&] { return stopped; });
    BOOST_TEST(n.job->stopped());
    n.job->done(); // ignored
    answer<int> next;
    n.tower.async_pull<int>("car1:speed", next.take());
    n.wait_for(next);
    BOOST_TEST(late.calls == 1);
}

CLES_DATA_TEST_CASE(a_cancellation_slot_withdraws_at_the_peer, carriers, kind) {
    two_nodes n{kind};
    answer<> withdrawn;
    boost::asio::cancellation_signal signal;
    bool stopped = false;
    n.tower.async_delegate("car1:drive", cles::json_text{}, withdrawn.options(),
                           boost::asio::bind_cancellation_slot(signal.slot(), withdrawn.take()));
    run_until(n.io, [&] { return n.job.has_value(); });
    n.job->on_stop([&] { stopped = true; });
    signal.emit(boost::asio::cancellation_type::terminal);
    n.wait_for(withdrawn);
    BOOST_TEST(withdrawn.code == errc::cancelled);
    run_until(n.io, [&] { return stopped; });
    BOOST_TEST(!n.job->progress(0.5)); // without a listener
    signal.emit(boost::asio::cancellation_type::terminal);
    run_ready(n.io);
    BOOST_TEST(withdrawn.calls == 1);
}

CLES_DATA_TEST_CASE(a_lost_link_fails_what_is_in_flight_at_once, carriers, kind) {
    two_nodes n{kind};
    answer<> lost;
    n.tower.async_delegate("car1:drive", cles::json_text{}, lost.options(), lost.take());
    run_until(n.io, [&] { return n.job.has_value(); });
    n.car.stop();
    n.wait_for(lost);
    BOOST_TEST(lost.code == errc::unavailable);
    BOOST_TEST(!lost.words.empty());
    BOOST_TEST(n.job->stopped());
}

CLES_DATA_TEST_CASE(connect_refused_is_the_systems_error_at_once, carriers, kind) {
    two_nodes n{kind};
    n.car.stop();
    answer<> refused;
    n.tower.async_pull("car1:speed", refused.options(), refused.take());
    n.wait_for(refused);
    const bool fits = refused.code == boost::asio::error::connection_refused ||
                      refused.code == boost::system::errc::no_such_file_or_directory;
    BOOST_TEST(fits, refused.code.message());
    BOOST_TEST(refused.words.find(n.tower.name()) == std::string::npos);
    BOOST_TEST(refused.words.starts_with("cannot connect to "), refused.words);
}

CLES_DATA_TEST_CASE(the_next_request_after_a_loss_makes_a_new_link, carriers, kind) {
    two_nodes n{kind};
    answer<int> first;
    n.tower.async_pull<int>("car1:speed", first.take());
    n.wait_for(first);
    const auto where = n.car.endpoints().front();
    n.car.stop();
    run_ready(n.io);
    cles::service again{n.io, {.name = "car1", .listen = {where}}};
    again.on_pull("speed", [] { return 43; });
    answer<int> second;
    n.tower.async_pull<int>("car1:speed", second.take());
    n.wait_for(second);
    BOOST_TEST(second.value == 43);
}

BOOST_AUTO_TEST_CASE(an_unknown_name_is_no_target) {
    boost::asio::io_context io;
    cles::service tower{io, {.name = "tower"}};
    for (const auto* noun : {"nobody:speed", "any:speed", "all:speed"}) {
        answer<> a;
        tower.async_pull(noun, a.options(), a.take());
        BOOST_TEST(!a.done()); // never inside the call
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.code == errc::no_target, noun << ": " << a.code.message());
        BOOST_TEST(!a.words.empty());
        BOOST_TEST(a.words.find("://") == std::string::npos, a.words); // internal addresses must not be revealed
    }
}

BOOST_AUTO_TEST_CASE(a_sentence_that_is_wrong_fails_before_anything_is_sent) {
    boost::asio::io_context io;
    cles::service tower{io, {.name = "tower"}};
    for (const auto* command : {"", "PULL", "FETCH car1:x", "PULL car1", "PULL car1:x/", "PUSH car1:x {", "BIND car1:x",
                                "UPDATE car1:x seq=1 epoch=00000000 {}", "PUSH car1:x {\"a\":\"\xff\"}"}) {
        answer<> a;
        tower.async_request(command, a.options(), a.take());
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.code == errc::bad_request, command);
        BOOST_TEST(!a.words.empty());
    }
}

BOOST_AUTO_TEST_CASE(at_sends_a_request_anywhere) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1")};
    car.on_pull("speed", [] { return 42; });
    cles::service tower{io, {.name = "tower"}};
    answer<int> there;
    answer<> nowhere;
    tower.async_pull<int>("self:speed", there.options().at(car.endpoints().front()), there.take());
    tower.async_pull("self:speed", nowhere.options().at("smoke://signals"), nowhere.take());
    run_until(io, [&] { return there.done() && nowhere.done(); });
    BOOST_TEST(there.value == 42);
    BOOST_TEST(nowhere.code == errc::unknown_scheme);
}

BOOST_AUTO_TEST_CASE(set_peer_changes_the_address_of_a_node) {
    boost::asio::io_context io;
    cles::service one{io, listening("one")};
    cles::service two{io, listening("two", carrier::unix_file)};
    one.on_pull("who", [] { return 1; });
    two.on_pull("who", [] { return 2; });
    cles::service tower{io, {.name = "tower"}};
    const auto who = [&] {
        answer<int> a;
        tower.async_pull<int>("friend:who", a.options(), a.take());
        run_until(io, [&] { return a.done(); });
        return a.code ? a.code.message() : std::to_string(a.value);
    };
    const auto unknown = make_error_code(errc::no_target).message();
    BOOST_TEST(who() == unknown);
    // A node replies to requests for the name `friend` only if that is its name, and reports otherwise.
    tower.set_peer("friend", one.endpoints().front());
    BOOST_TEST(who() == unknown);
    cles::service bearer{io, listening("friend")};
    bearer.on_pull("who", [] { return 3; });
    tower.set_peer("friend", bearer.endpoints().front());
    BOOST_TEST(who() == "3");
    tower.set_peer("Friend", two.endpoints().front()); // another name
    tower.set_peer("nobody", "");                      // not configured
    BOOST_TEST(who() == "3");
    tower.set_peer("friend", two.endpoints().front());
    BOOST_TEST(who() == unknown);
    tower.set_peer("friend", ""); // forgotten; but a node of that name is on this context
    BOOST_TEST(who() == "3");
}

// As with Asio's own operations: an exception from a handler leaves the context's run, and affects nothing else.
CLES_DATA_TEST_CASE(a_completion_handler_that_throws_affects_no_other, carriers, kind) {
    two_nodes n{kind};
    struct thrown_by_test {};
    int thrown = 0;
    std::vector<answer<int>> all(20);
    for (auto& a : all) {
        n.tower.async_pull<int>("car1:speed", a.take());
        n.tower.async_pull("car1:speed",
                           [&](boost::system::error_code, const cles::json_text&) { throw thrown_by_test{}; });
    }
    const auto run = [&] {
        try {
            run_until(n.io,
                      [&] { return std::all_of(all.begin(), all.end(), [](const auto& a) { return a.done(); }); });
        } catch (const thrown_by_test&) {
            ++thrown;
            return true;
        }
        return false;
    };
    while (run()) {
    }
    BOOST_TEST(thrown >= 19);
    answer<int> next;
    n.tower.async_pull<int>("car1:speed", next.take());
    while (!next.done()) {
        try {
            n.wait_for(next);
        } catch (const thrown_by_test&) {
            ++thrown;
        }
    }
    BOOST_TEST(next.value == 42);
    BOOST_TEST(thrown == 20);
}

BOOST_AUTO_TEST_CASE(services_of_one_context_reach_each_other_without_a_socket) {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car1"}};
    car.on_pull("speed", [] { return 42; });
    car.on_pull("transport", [](const cles::request& r) { return r.peer().transport; });
    cles::service tower{io, {.name = "tower"}};
    answer<int> other;
    answer<int> self;
    answer<std::string> transport;
    tower.async_pull<int>("car1:speed", other.take());
    car.async_pull<int>("self:speed", self.take());
    car.async_pull<std::string>("car1:transport", transport.take());
    run_until(io, [&] { return other.done() && self.done() && transport.done(); });
    BOOST_TEST(other.value == 42);
    BOOST_TEST(self.value == 42);
    BOOST_TEST(transport.value == "inproc");
}

BOOST_AUTO_TEST_CASE(an_answer_that_is_no_json_is_dropped_and_the_right_one_awaited) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower"}};
    answer<int> a;
    tower.async_pull<int>("car1:speed", a.options().at(listener.url()), a.take());
    auto peer = listener.accept();
    const auto asked = peer.line();
    BOOST_TEST(asked.starts_with("PULL car1:speed id="), asked);
    const auto id = asked.substr(asked.find("id="), asked.find(' ', asked.find("id=")) - asked.find("id="));
    peer.send("{\"value\":1}\nid=999 {\"value\":2}\n" + id + " {\"value\":\n" + id + " {\"value\":4}\n");
    run_until(io, [&] { return a.done(); });
    BOOST_TEST(a.value == 4);
}

BOOST_AUTO_TEST_CASE(a_peer_that_ends_its_side_without_an_answer_is_unavailable) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower"}};
    for (const bool reset : {false, true}) {
        answer<> a;
        tower.async_pull("car1:speed", a.options().at(listener.url()), a.take());
        auto peer = listener.accept();
        peer.line();
        if (reset) {
            peer.reset();
        } else {
            peer.shut();
        }
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.code == errc::unavailable);
    }
}

BOOST_AUTO_TEST_CASE(an_answer_over_the_limit_is_too_large) {
    boost::asio::io_context io;
    scripted_listener listener{io};
    cles::service tower{io, {.name = "tower", .limits = {.line = 1000}}};
    answer<> a;
    tower.async_pull("car1:speed", a.options().at(listener.url()), a.take());
    auto peer = listener.accept();
    const auto asked = peer.line();
    const auto id = asked.substr(asked.find("id="));
    peer.send(id + " {\"value\":\"" + std::string(2000, 'x') + "\"}\n");
    run_until(io, [&] { return a.done(); });
    BOOST_TEST(a.code == errc::too_large);
}

BOOST_AUTO_TEST_SUITE_END()
