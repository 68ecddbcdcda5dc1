// SPDX-License-Identifier: BSL-1.0
// The trace of a request, through services and the requests that their handlers send.

#include <cles/service.hpp>
#include <cles/tracing.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/json.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace tracing {
namespace {

namespace json = boost::json;
using namespace cles::test;

const std::string trace = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
const std::string spans_noun = ":cles/trace/4bf92f3577b34da6a3ce929d0e0e4736";

/// The user asks the car, which asks the tower.
struct nodes {
    explicit nodes(const cles::detail::tracing_part* at_the_car = cles::tracing()) {
        auto options = listening("tower");
        options.tracing = cles::tracing();
        tower = std::make_unique<cles::service>(io, options);
        tower->on_pull("wind", [this](const cles::request& asked) {
            seen = asked.trace();
            return 7;
        });
        options = listening("car");
        options.tracing = at_the_car;
        options.peers.emplace("tower", tower->endpoints().front());
        car = std::make_unique<cles::service>(io, options);
        car->on_delegate("job", [](const cles::request&, const cles::responder& answer) {
            answer.delegate("PULL tower:wind", [answer](auto, std::string_view text, std::string_view) {
                answer.done(cles::json_text{std::string{text}});
            });
        });
        car->on_delegate("coroutine", [this](cles::request asked) -> boost::asio::awaitable<int> {
            const auto chosen = cles::call_options{}.trace(asked.trace());
            const int wind = co_await car->async_pull<int>("tower:wind", chosen);
            co_return wind;
        });
        options = knowing("user", *car);
        options.peers.emplace("tower", tower->endpoints().front());
        user = std::make_unique<cles::service>(io, options);
    }

    std::string ask(const std::string& command, const std::string& parent = {}) {
        answer<> got;
        user->async_request(command, got.options().trace(parent), got.take());
        run_until(io, [&] { return got.done(); });
        return got.code ? got.words : got.value.text;
    }
    json::array spans_of(const std::string& node) {
        return json::parse(ask("PULL " + node + spans_noun)).at("spans").as_array();
    }

    boost::asio::io_context io;
    std::string seen;
    std::unique_ptr<cles::service> tower;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> user;
};

struct without_a_recorder : nodes {
    without_a_recorder() : nodes(nullptr) {}
};

void check_continued(nodes& all, const std::string& command) {
    BOOST_TEST(all.ask(command, trace) == R"({"value":7})");
    const auto at_car = all.spans_of("car");
    BOOST_REQUIRE(at_car.size() == 2U);
    BOOST_TEST(at_car[0].at("parent").as_string() == "00f067aa0ba902b7");
    BOOST_TEST(at_car[1].at("kind").as_string() == "sent");
    BOOST_TEST(at_car[1].at("parent").as_string() == at_car[0].at("span").as_string());
    BOOST_TEST(at_car[1].at("target").as_string() == "tower");
    BOOST_TEST(at_car[1].at("outcome").as_string() == "ok");
    const auto at_tower = all.spans_of("tower");
    BOOST_REQUIRE(at_tower.size() == 1U);
    BOOST_TEST(at_tower[0].at("parent").as_string() == at_car[1].at("span").as_string());
    BOOST_TEST(all.seen.substr(0, 36) == trace.substr(0, 36));
    BOOST_TEST(all.seen.substr(36, 16) == std::string_view{at_tower[0].at("span").as_string()});
}

} // namespace
} // namespace tracing

BOOST_FIXTURE_TEST_SUITE(tracing, nodes)

BOOST_AUTO_TEST_CASE(a_request_on_behalf_of_a_job_continues_its_trace) { check_continued(*this, "DELEGATE car:job"); }

BOOST_AUTO_TEST_CASE(a_request_of_a_coroutine_continues_the_trace_that_it_is_given) {
    check_continued(*this, "DELEGATE car:coroutine");
}

BOOST_AUTO_TEST_CASE(a_request_without_a_trace_begins_none) {
    ask("DELEGATE car:job");
    BOOST_TEST(seen.empty());
    BOOST_TEST(spans_of("car").empty());
}

BOOST_FIXTURE_TEST_CASE(a_node_without_a_recorder_passes_the_trace_on, without_a_recorder) {
    ask("DELEGATE car:job", trace);
    const auto at_tower = spans_of("tower");
    BOOST_REQUIRE(at_tower.size() == 1U);
    BOOST_TEST(at_tower[0].at("parent").as_string() == "00f067aa0ba902b7");
    BOOST_TEST(ask("PULL car" + spans_noun).find("no PULL") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(an_invalid_option_is_refused) {
    BOOST_TEST(ask("DELEGATE car:job", "00-4bf9-01").find("call_options::trace is '00-4bf9-01'") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_request_that_cannot_be_sent_has_a_span) {
    user.reset();
    auto options = knowing("user", *car);
    options.tracing = cles::tracing();
    options.listen = {fresh_address(carrier::tcp4)};
    options.peers.emplace("nobody", "tcp://127.0.0.1:1");
    user = std::make_unique<cles::service>(io, options);
    ask("PULL nobody:wind", trace);
    const auto at_user = spans_of("self");
    BOOST_REQUIRE(at_user.size() == 1U);
    BOOST_TEST(at_user[0].at("outcome").as_string() == "unavailable");
    user.reset(); // with a request in progress
}

BOOST_AUTO_TEST_SUITE_END()
