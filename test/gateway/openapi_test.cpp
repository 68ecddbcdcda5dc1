// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>

#include "gateway/told/metrics.hpp"
#include "gateway/told/openapi.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace openapi {
namespace {

constexpr const char* two_cars =
    R"({"results":{"car1":{"node":"car1","types":"d1","tasks":[)"
    R"({"verb":"PUSH","task":"target","description":"Drives \"there\"","parameters":["lane"],"more":1},)"
    R"({"verb":"PULL","task":"speed"},{"verb":"BIND","task":"speed"}]},)"
    R"("car2":{"node":"car2","tasks":[]},"car3":{"node":"car3"},"car4":7},"errors":{}})";

std::vector<gateway::offering_node> nodes_in(std::string_view reply) {
    return gateway::offering_nodes(gateway::results_of_all(reply));
}
std::vector<gateway::offering_node> cars() { return nodes_in(two_cars); }

bool contains_text(const std::string& document, const std::string& part) {
    return document.find(part) != std::string::npos;
}

/// The document with what car1 tells about the types of `target`.
std::string document_with(const std::string& told) {
    auto nodes = openapi::cars();
    gateway::add_schemas(nodes.front(), "target", told);
    auto document = gateway::openapi_document(nodes);
    std::string why;
    BOOST_TEST(cles::is_valid_json(document, 64, &why), why);
    return document;
}

} // namespace
} // namespace openapi

BOOST_AUTO_TEST_SUITE(openapi)

BOOST_AUTO_TEST_CASE(nodes_tell_what_they_offer) {
    const auto nodes = openapi::cars();
    BOOST_TEST_REQUIRE(nodes.size() == 2U);
    BOOST_TEST(nodes[0].name == "car1");
    BOOST_TEST(nodes[0].types == "d1");
    BOOST_TEST(nodes[0].tasks.size() == 3U);
    BOOST_TEST(nodes[1].types == "");
    BOOST_TEST(nodes_in("[]").empty());
}

BOOST_AUTO_TEST_CASE(each_task_is_an_operation) {
    const auto document = openapi::document_with("{}");
    BOOST_TEST(document.starts_with(R"({"openapi":"3.1.0","info":{"title":"CLES gateway","version":)"));
    for (
        const auto* const part :
        {R"("/push/car1/target/{lane}":{"post":{"operationId":"push/car1/target/{lane}","summary":"Drives \"there\"","tags":["car1"])",
         R"({"name":"lane","in":"path","required":true,"schema":{"type":"string"}})",
         R"("requestBody":{"content":{"application/json":{"schema":{}}}})",
         R"("/pull/car1/speed":{"get":{"operationId":"pull/car1/speed","summary":"PULL car1:speed")",
         R"("/bind/car1/speed":{"get":{)", R"("content":{"text/event-stream":{"schema":{}}})"}) {
        BOOST_TEST(openapi::contains_text(document, part), part);
    }
    BOOST_TEST(!openapi::contains_text(document, "car4"));
}

BOOST_AUTO_TEST_CASE(schemas_are_those_that_nodes_tell) {
    const auto document = openapi::document_with(
        R"({"PUSH":{"body":{"$defs":{"p":{"type":"number"}},"$ref":"#/$defs/p"},"result":{"type":"boolean"}}})");
    for (
        const auto* const part :
        {R"("schema":{"$ref":"#/components/schemas/car1.PUSH.target.body"})",
         R"("car1.PUSH.target.body":{"$defs":{"p":{"type":"number"}},"$ref":"#/components/schemas/car1.PUSH.target.body/$defs/p"})",
         R"("car1.PUSH.target.result":{"type":"boolean"})"}) {
        BOOST_TEST(openapi::contains_text(document, part), document);
    }
}

// A short reference becomes a long one, so the limit is that of what is written.
BOOST_AUTO_TEST_CASE(moved_references_count_for_the_limit) {
    std::string definitions = R"("d0":{"$ref":"#"})";
    for (int i = 1; i < 2000; ++i) {
        definitions += R"(, "d)" + std::to_string(i) + R"(":{"$ref":"#/$defs/d0"})";
    }
    const auto told = R"({"PUSH":{"body":{"$defs":{)" + definitions + R"(},"type":"object"}}})";
    auto nodes = openapi::cars();
    auto& tasks = nodes.front().tasks;
    tasks.clear();
    for (int i = 0; i < 80; ++i) {
        tasks.push_back(
            {.verb = "PUSH", .task = std::string(60, 't') + std::to_string(i), .description = {}, .parameters = {}});
        gateway::add_schemas(nodes.front(), tasks.back().task, told);
    }
    const auto document = gateway::openapi_document(nodes);
    BOOST_TEST(cles::is_valid_json(document, 64));
    const auto root = "#/components/schemas/car1.PUSH." + tasks.front().task + ".body";
    BOOST_TEST(openapi::contains_text(document, R"({"$defs":{"d0":{"$ref":")" + root + R"("},"d1":{"$ref":")" + root +
                                                    R"(/$defs/d0"},"d2":)"));
    BOOST_TEST(openapi::contains_text(document, root + R"(/$defs/d0"}},"type":"object"},)"));
    BOOST_TEST(document.size() > (7U << 20U));
    BOOST_TEST(document.size() < (8U << 20U) + 100'000U);
}

BOOST_AUTO_TEST_CASE(what_is_no_schema_is_left_out) {
    for (const auto* const told :
         {"", "[]", R"({"PUSH":7})", R"({"PUSH":{"body":7}})", R"({"PUSH":{"body":{"type":"car"}}})",
          R"({"PUSH":{"body":{"unknown":1}}})", R"({"PUSH":{"body":)"}) {
        BOOST_TEST(!openapi::contains_text(openapi::document_with(told), "car1.PUSH"), told);
    }
}

BOOST_AUTO_TEST_CASE(what_could_not_be_requested_is_left_out) {
    auto nodes = openapi::cars();
    nodes.front().tasks = {{.verb = "PUSH", .task = "a/b\"", .description = {}, .parameters = {}},
                           {.verb = "FLY", .task = "away", .description = {}, .parameters = {}},
                           {.verb = "PULL",
                            .task = "speed",
                            .description = {},
                            .parameters = std::vector<std::string>{"a b", "x", "x", ""}},
                           {.verb = "PULL", .task = "speed", .description = {}, .parameters = {}}};
    const auto document = gateway::openapi_document(nodes);
    BOOST_TEST(!openapi::contains_text(document, "a/b"));
    BOOST_TEST(!openapi::contains_text(document, "away"));
    BOOST_TEST(openapi::contains_text(document, R"("/pull/car1/speed/{p1}/{x}/{p3}/{p4}")"));
    BOOST_TEST(!openapi::contains_text(document, R"("/pull/car1/speed":)")); // it was told twice
    BOOST_TEST(cles::is_valid_json(document, 64));
}

BOOST_AUTO_TEST_CASE(what_is_too_long_or_too_much_is_left_out) {
    std::string names = "\"p0\"";
    for (int i = 1; i < 33; ++i) {
        names += ",\"p" + std::to_string(i) + "\"";
    }
    std::string tasks = R"({"verb":"PUSH","task":"wide","parameters":[)" + names + "]},";
    tasks += R"({"verb":"PUSH","task":"told","description":")" + std::string(1025, 'd') + R"(","parameters":[")" +
             std::string(65, 'p') + "\"]}";
    for (int i = 0; i < 2000; ++i) {
        tasks += R"(,{"verb":"PULL","task":"t)" + std::to_string(i) + "\"}";
    }
    auto nodes =
        nodes_in(R"({"results":{"car1":{"types":")" + std::string(65, 'a') + R"(","tasks":[)" + tasks + "]}}}");
    BOOST_TEST_REQUIRE(nodes.size() == 1U);
    BOOST_TEST(nodes[0].types == "");
    BOOST_TEST_REQUIRE(nodes[0].tasks.size() == 1024U);
    BOOST_TEST(nodes[0].tasks[0].task == "told");
    BOOST_TEST(!nodes[0].tasks[0].description.has_value());
    BOOST_TEST(openapi::contains_text(gateway::openapi_document(nodes), R"("/push/car1/told/{p1}")"));
    gateway::add_schemas(nodes[0], "told", R"({"FLY":{"body":{}},"PUSH":{"body":{}}})");
    BOOST_TEST(nodes[0].schemas.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
