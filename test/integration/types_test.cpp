// SPDX-License-Identifier: BSL-1.0
// What a node tells about the types of its tasks.

#include <cles/schema.hpp>
#include <cles/service.hpp>
#include <cles/types.hpp>

#include "support/answer.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe.hpp>
#include <boost/json.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace types {
namespace {

namespace json = boost::json;
using namespace cles::test;

struct target {
    double lat = 0;
    double lon = 0;
};
BOOST_DESCRIBE_STRUCT(target, (), (lat, lon))
CLES_FIELD(target, lat, "deg", "latitude", -90, 90)

struct nodes {
    explicit nodes(const cles::detail::types_part* types = cles::types()) {
        auto options = listening("car");
        options.types = types;
        options.authorise = [](const cles::access& asked) {
            return asked.verb != cles::verb::bind || asked.task != "secret";
        };
        car = std::make_unique<cles::service>(io, options);
        cles::typed_registrar tasks{*car};
        tasks.on_push("target", [](const target&) { return 7; });
        tasks.on_bind<target>("target");
        tasks.on_push("raw", [](const cles::json_text&) {}, {}, {.body = R"({"type":"object"})"});
        car->on_pull("untyped", [] { return 1; });
        user = std::make_unique<cles::service>(io, knowing("user", *car));
    }

    std::string ask(const std::string& command) {
        answer<> got;
        user->async_request(command, got.options(), got.take());
        run_until(io, [&] { return got.done(); });
        return got.code ? got.words : got.value.text;
    }
    json::object described() { return json::parse(ask("PULL car:cles")).as_object(); }

    boost::asio::io_context io;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> user;
};

struct silent : nodes {
    silent() : nodes(nullptr) {}
};

} // namespace
} // namespace types

BOOST_FIXTURE_TEST_SUITE(types, nodes)

BOOST_AUTO_TEST_CASE(a_task_tells_its_types_by_verb) {
    const auto told = json::parse(ask("PULL car:cles/types/target")).as_object();
    const auto body = json::serialize(told.at("PUSH").at("body"));
    BOOST_TEST(body == cles::schema_of<target>());
    BOOST_TEST(json::serialize(told.at("PUSH").at("result")) == cles::schema_of<int>());
    BOOST_TEST(json::serialize(told.at("BIND").at("updates")) == cles::schema_of<target>());
    BOOST_TEST(cles::schema{body}.mismatch(R"({"lat":91,"lon":0})").starts_with("lat: "));
    BOOST_TEST(ask("PUSH car:target {\"lat\":91,\"lon\":0}").find("lat: a number outside") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_stated_schema_is_told) {
    BOOST_TEST(ask("PULL car:cles/types/raw") ==
               R"({"PUSH":{"body":{"type":"object"},"result":{"type":"object","maxProperties":0}}})");
    cles::typed_registrar tasks{*car};
    BOOST_CHECK_THROW(tasks.on_push("bad", [](const cles::json_text&) {}, {}, {.body = R"({"oneOf":[]})"}),
                      cles::error);
}

BOOST_AUTO_TEST_CASE(a_task_without_types_tells_nothing) {
    BOOST_TEST(ask("PULL car:cles/types/untyped") == "{}");
    BOOST_TEST(ask("PULL car:cles/types/none").find("no task") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(the_digest_changes_with_the_types) {
    const auto first = described();
    BOOST_TEST(json::serialize(first.at("features")).find("types") != std::string::npos);
    cles::typed_registrar tasks{*car};
    tasks.on_push("more", [](const target&) {});
    const auto second = described();
    BOOST_TEST(first.at("types").as_string().size() == 16U);
    BOOST_TEST(first.at("types").as_string() != second.at("types").as_string());
}

BOOST_AUTO_TEST_CASE(only_nouns_that_may_be_bound_are_listed) {
    car->update("target", target{.lat = 1, .lon = 2});
    car->update("tyre/front", 2.5);
    car->update("secret", 1);
    BOOST_TEST(ask("PULL car:cles/nouns") == R"({"nouns":["target","tyre/front"]})");
}

BOOST_FIXTURE_TEST_CASE(a_node_that_does_not_tell_them_says_so, silent) {
    BOOST_TEST(ask("PULL car:cles/types/target").find("has no PULL 'cles/types/target'") != std::string::npos);
    BOOST_TEST(!described().contains("types"));
}

BOOST_AUTO_TEST_SUITE_END()
