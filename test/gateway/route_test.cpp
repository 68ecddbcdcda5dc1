// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/route.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace route {
namespace {

using gateway::place;
using namespace std::chrono_literals;

gateway::route found(std::string_view method, std::string_view target) {
    auto made = gateway::route_of(method, target);
    BOOST_TEST_REQUIRE(made.index() == 0U, target);
    return std::get<gateway::route>(std::move(made));
}

std::string noun_of(std::string_view method, std::string_view target) {
    const auto made = route::found(method, target);
    BOOST_TEST((made.to == place::fleet));
    return std::string{cles::to_string(made.verb)} + " " + made.noun;
}

/// The status with which this is refused; 200 if it is not.
int status_of(std::string_view method, std::string_view target) {
    const auto made = gateway::route_of(method, target);
    const auto* const why = std::get_if<gateway::refusal>(&made);
    return why == nullptr ? 200 : why->status;
}

gateway::http_request with(std::string name, std::string value, std::string body = {}) {
    gateway::http_request made;
    made.fields.emplace_back(std::move(name), std::move(value));
    made.body = std::move(body);
    return made;
}

/// The body that is sent, or the status with which this one is refused.
std::string body_of(std::string type, std::string body) {
    const auto made = gateway::body_of(route::with("content-type", std::move(type), std::move(body)));
    const auto* const why = std::get_if<gateway::refusal>(&made);
    return why == nullptr ? std::get<std::string>(made) : std::to_string(why->status);
}

} // namespace
} // namespace route

BOOST_AUTO_TEST_SUITE(route)

BOOST_AUTO_TEST_CASE(the_verb_is_in_the_path) {
    BOOST_TEST(noun_of("GET", "/pull/car1/localization") == "PULL car1:localization");
    BOOST_TEST(noun_of("GET", "/bind/all/localization") == "BIND all:localization");
    BOOST_TEST(noun_of("POST", "/push/any/target") == "PUSH any:target");
    BOOST_TEST(noun_of("POST", "/delegate/north.car1/plan") == "DELEGATE north.car1:plan");
    BOOST_TEST(noun_of("POST", "/update/car1/notice") == "UPDATE car1:notice");
    BOOST_TEST(route::found("GET", "/pull/north.car1/a").target == "north.car1");
}

BOOST_AUTO_TEST_CASE(the_verb_decides_on_the_method) {
    BOOST_TEST(status_of("POST", "/pull/car1/a") == 405);
    BOOST_TEST(status_of("HEAD", "/pull/car1/a") == 405);
    BOOST_TEST(status_of("GET", "/push/car1/a") == 405);
    BOOST_TEST(status_of("PUT", "/delegate/car1/a") == 405);
    const auto made = gateway::route_of("GET", "/push/car1/a");
    const auto& why = std::get<gateway::refusal>(made);
    BOOST_TEST_REQUIRE(why.fields.size() == 1U);
    BOOST_TEST(why.fields[0].first == "Allow");
    BOOST_TEST(why.fields[0].second == "POST");
}

BOOST_AUTO_TEST_CASE(parameters_may_have_any_characters) {
    BOOST_TEST(noun_of("GET", "/pull/car1/echo/one/two") == "PULL car1:echo/one/two");
    BOOST_TEST(noun_of("GET", "/pull/car1/echo/a%2fb%20c") == "PULL car1:echo/a%2Fb%20c");
    BOOST_TEST(noun_of("GET", "/pull/car1/echo/a:b=c") == "PULL car1:echo/a%3Ab%3Dc");
    BOOST_TEST(noun_of("GET", "/pull/%63ar1/echo") == "PULL car1:echo");
    std::string many = "/pull/car1/a";
    for (int i = 0; i < 32; ++i) {
        many += "/p";
    }
    BOOST_TEST(status_of("GET", many) == 200);
    BOOST_TEST(status_of("GET", many + "/p") == 400);
}

BOOST_AUTO_TEST_CASE(paths_that_others_could_read_differently_are_refused) {
    for (const auto* const path : {"/pull",
                                   "/pull/",
                                   "/pull/car1",
                                   "/pull/car1/",
                                   "/pull//a",
                                   "/pull/car1//",
                                   "/pull/car1/a/",
                                   "/pull/car1/a//b",
                                   "/pull/car1/..",
                                   "/pull/car1/a/..",
                                   "/pull/car1/a/../b",
                                   "/pull/car1/a/%2e%2E",
                                   "/pull/car1/a/.",
                                   "/pull/../a",
                                   "/pull/car1/a%",
                                   "/pull/car1/a%2",
                                   "/pull/car1/a/%zz",
                                   "/pull/car1/a/%+1",
                                   "/pull/car1/a/%00",
                                   "/pull/car1/a/%0a",
                                   "/pull/car1/a/%c2%85",
                                   "/pull/car1/a/%ff",
                                   "/pull/car1/a%20b",
                                   "/pull/car1/a%2fb",
                                   "/pull/car%201/a",
                                   "/pull/car1:a/b",
                                   "/pull/car1/a%0aPULL",
                                   "pull/car1/a",
                                   ""}) {
        BOOST_TEST(status_of("GET", path) == 400, path);
    }
    BOOST_TEST(status_of("GET", "/pull/" + std::string(64, 'a') + "/b") == 200);
    BOOST_TEST(status_of("GET", "/pull/" + std::string(65, 'a') + "/b") == 400);
}

BOOST_AUTO_TEST_CASE(a_binding_has_terms) {
    const auto made = route::found("GET", "/bind/car1/localization?every=100&keep=3");
    BOOST_TEST((made.every == 100ms));
    BOOST_TEST(made.keep == 3U);
    for (const auto* const query : {"every=0", "every=x", "every=", "every", "keep=65537", "every=-1", "every=86400001",
                                    "other=1", "every=1&other=2", "token=abc"}) {
        BOOST_TEST(status_of("GET", "/bind/car1/a?" + std::string{query}) == 400, query);
    }
    BOOST_TEST(status_of("GET", "/pull/car1/a?every=1") == 400);
    BOOST_TEST(status_of("GET", "/pull/car1/a?") == 200);
}

// Its other requests concern the link between nodes.
BOOST_AUTO_TEST_CASE(the_reserved_task_takes_pull_only) {
    BOOST_TEST(noun_of("GET", "/pull/self/cles/metrics") == "PULL self:cles/metrics");
    BOOST_TEST(status_of("POST", "/push/self/cles/hello") == 403);
    BOOST_TEST(status_of("POST", "/push/self/cles") == 403);
    BOOST_TEST(status_of("POST", "/update/car1/cles/cancel/1") == 403);
    BOOST_TEST(status_of("POST", "/delegate/car1/%63les") == 403);
    BOOST_TEST(status_of("GET", "/bind/self/cles/announced") == 403);
    BOOST_TEST(status_of("POST", "/push/self/clesx") == 200);
}

BOOST_AUTO_TEST_CASE(other_paths) {
    BOOST_TEST((route::found("GET", "/").to == place::page));
    BOOST_TEST(route::found("GET", "/app.js?v=1").path == "/app.js");
    BOOST_TEST((route::found("GET", "/pullover").to == place::page));
    BOOST_TEST((route::found("GET", "/metrics").to == place::metrics));
    BOOST_TEST((route::found("GET", "/openapi.json").to == place::openapi));
    for (const auto* const method : {"GET", "POST", "DELETE"}) {
        BOOST_TEST((route::found(method, "/session").to == place::session));
    }
    BOOST_TEST(status_of("PUT", "/session") == 405);
    BOOST_TEST(status_of("POST", "/metrics") == 405);
    BOOST_TEST(status_of("POST", "/") == 405);
}

BOOST_AUTO_TEST_CASE(a_deadline_is_in_a_header) {
    using std::chrono::milliseconds;
    BOOST_TEST((std::get<milliseconds>(gateway::deadline_of({})) == 0ms));
    BOOST_TEST((std::get<milliseconds>(gateway::deadline_of(route::with("cles-deadline", "500"))) == 500ms));
    for (const auto* const text : {"", "0", "-1", "1s", "86400001", "99999999999999999999999"}) {
        BOOST_TEST(gateway::deadline_of(route::with("cles-deadline", text)).index() == 1U, text);
    }
}

BOOST_AUTO_TEST_CASE(a_body_is_json_on_one_line) {
    BOOST_TEST(route::body_of("application/json", "{\n  \"a\": [1, 2]\n}\n") == R"({"a":[1,2]})");
    BOOST_TEST(route::body_of("Application/JSON; charset=utf-8", "[1]") == "[1]");
    BOOST_TEST(route::body_of("application/json", "3") == R"({"value":3})");
    BOOST_TEST(route::body_of("application/json", "\"a\"") == R"({"value":"a"})");
    BOOST_TEST(route::body_of("application/json", "") == "");
    BOOST_TEST(route::body_of("text/plain", "") == "");
    BOOST_TEST(route::body_of("application/json", "{\"a\":}") == "400");
    BOOST_TEST(route::body_of("application/json", "{} {}") == "400");
    BOOST_TEST(route::body_of("application/json", "{}\nPUSH car1:a {}") == "400");
    // Forms of other pages cannot send this type.
    BOOST_TEST(route::body_of("text/plain", "{}") == "415");
    BOOST_TEST(route::body_of("", "{}") == "415");
    BOOST_TEST(route::body_of("application/x-www-form-urlencoded", "a=1") == "415");
}

BOOST_AUTO_TEST_SUITE_END()
