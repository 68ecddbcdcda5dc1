// SPDX-License-Identifier: BSL-1.0
#include <cles/version.hpp>

#include "node/node_state.hpp"
#include "support/session_fixture.hpp"

#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>
#include <boost/json/value.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace node {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    boost::json::value pull(std::string_view noun) { return boost::json::parse(link.ask("PULL " + std::string{noun})); }
    std::int64_t metric(std::string_view name) { return pull("self:cles/metrics").at(name).as_int64(); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace node

BOOST_FIXTURE_TEST_SUITE(node, fixture)

BOOST_AUTO_TEST_SUITE(description)

BOOST_AUTO_TEST_CASE(pull_self_cles_returns_the_description_of_the_node) {
    node.host->endpoints = {"tcp://127.0.0.1:25370", "unix:///run/car1.sock"};
    node.pass(1500ms);
    BOOST_TEST(link.ask("PULL self:cles id=7") ==
               "id=7 {\"node\":\"car1\",\"version\":\"" + std::string{cles::version} +
                   "\",\"protocol\":1,\"features\":[\"mark\"],\"limits\":{\"line\":1048576},"
                   "\"epoch\":\"5f3a09c1\",\"uptime_ms\":1500,"
                   "\"endpoints\":[\"tcp://127.0.0.1:25370\",\"unix:///run/car1.sock\"],"
                   "\"tasks\":[],\"load\":{\"queued\":0,\"running\":0,\"workers\":0}}\n");
    BOOST_TEST(link.kind("PULL car1:cles") == "ok");
}

BOOST_AUTO_TEST_CASE(each_task_is_listed_with_its_verb_and_description) {
    node.host->tasks.add(verb::pull, "speed",
                         {.info = {.description = "in \"m/s\"", .parameters = {"unit", "place"}},
                          .plain = [](const cles::request&, cles::json_writer&) {}});
    node.host->tasks.add(verb::push, "speed",
                         {.info = {.idempotent = true}, .plain = [](const cles::request&, cles::json_writer&) {}});
    const auto tasks = boost::json::serialize(pull("self:cles").at("tasks"));
    BOOST_TEST(tasks == "[{\"verb\":\"PULL\",\"task\":\"speed\",\"description\":\"in "
                        "\\\"m/s\\\"\",\"parameters\":[\"unit\",\"place\"]},"
                        "{\"verb\":\"PUSH\",\"task\":\"speed\",\"idempotent\":true}]");
}

BOOST_AUTO_TEST_CASE(every_task_that_can_be_bound_is_listed) {
    node.open("a_opened");
    node.on(verb::update, "b_updated", std::string{});
    node.on(verb::pull, "c_pulled", std::string{});
    node.publish_now("d_published/fast", "[1]");
    node.publish_now("c_pulled", "[1]");
    const auto tasks = boost::json::serialize(pull("self:cles").at("tasks"));
    BOOST_TEST(tasks == "[{\"verb\":\"BIND\",\"task\":\"a_opened\"},"
                        "{\"verb\":\"BIND\",\"task\":\"b_updated\"},{\"verb\":\"UPDATE\",\"task\":\"b_updated\"},"
                        "{\"verb\":\"PULL\",\"task\":\"c_pulled\"},{\"verb\":\"BIND\",\"task\":\"c_pulled\"},"
                        "{\"verb\":\"BIND\",\"task\":\"d_published\"}]");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(metrics)

BOOST_AUTO_TEST_CASE(requests_are_counted_by_verb) {
    node.on(verb::push, "log", std::string{});
    link.ask("PUSH car1:log");
    link.ask("PUSH car1:log reply=no");
    link.ask("PULL car1:nothing");
    const auto requests = pull("self:cles/metrics").at("requests");
    BOOST_TEST(boost::json::serialize(requests) == "{\"PULL\":2,\"PUSH\":2,\"DELEGATE\":0,\"BIND\":0,\"UPDATE\":0}");
}

BOOST_AUTO_TEST_CASE(errors_are_counted_even_if_they_are_not_sent) {
    link.ask("PULL car1:nothing");
    link.ask("FLY");
    link.ask("PUSH car1:nothing reply=no");
    BOOST_TEST(metric("errors") == 2);
    BOOST_TEST(metric("errors_unsent") == 1);
}

BOOST_AUTO_TEST_CASE(housekeeping_requests_are_counted_separately) {
    link.ask("PULL car1:cles");
    link.ask("PULL self:cles/peers");
    link.ask("PULL self:cles/peers since=0");
    link.ask("PUSH self:cles/peers {\"peers\":[]}"); // refused: the node takes no part in gossip
    link.ask("PUSH self:cles/peers reply=no {\"peers\":[]}");
    BOOST_TEST(metric("housekeeping") == 5);
    BOOST_TEST(metric("housekeeping_errors") == 2);
    BOOST_TEST(metric("errors") == 0);
    BOOST_TEST(metric("errors_unsent") == 0);
    const auto requests = pull("self:cles/metrics").at("requests");
    BOOST_TEST(boost::json::serialize(requests) == "{\"PULL\":5,\"PUSH\":0,\"DELEGATE\":0,\"BIND\":0,\"UPDATE\":0}");
}

BOOST_AUTO_TEST_CASE(dropped_messages_are_counted) {
    link.ask("id=7 {}");
    link.ask("UPDATE car2:speed seq=1 epoch=0000000a {}");
    BOOST_TEST(metric("replies_dropped") == 1);
    BOOST_TEST(metric("updates_dropped") == 1);
}

BOOST_AUTO_TEST_CASE(sent_updates_are_counted) {
    node.open("pose");
    cles::test::test_link subscriber{node};
    subscriber.ask("BIND car1:pose keep=1");
    node.publish_now("pose", "[1]");
    subscriber.takes = false;
    node.publish("pose", "[2]");
    node.publish("pose", "[3]");
    node.drain();
    BOOST_TEST(metric("updates_published") == 3);
    BOOST_TEST(metric("updates_delivered") == 1);
    BOOST_TEST(metric("updates_shed") == 1);
}

BOOST_AUTO_TEST_CASE(running_handlers_are_counted_until_they_release_their_call) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(metric("handlers_running") == 1);
    node.started.at(0)->call->done("[1]");
    link.take();
    node.started.clear();
    BOOST_TEST(metric("handlers_running") == 0);
}

BOOST_AUTO_TEST_CASE(latency_quantiles_are_reported_in_microseconds) {
    node.on_later(verb::delegate, "work");
    for (std::size_t i = 0; i < 10; ++i) {
        link.ask("DELEGATE car1:work id=7");
        node.pass(8ms);
        node.started.at(i)->call->done("[1]");
        link.take();
    }
    const auto quantiles = pull("self:cles/metrics").at("handler_us");
    BOOST_TEST(quantiles.at("samples").as_int64() == 10);
    for (const std::string_view name : {"p50", "p99", "p999"}) {
        const auto us = quantiles.at(name).to_number<double>();
        BOOST_TEST(us >= 8000.0);
        BOOST_TEST(us <= 9000.0);
    }
}

BOOST_AUTO_TEST_CASE(plain_handlers_are_sampled) {
    node.on(verb::pull, "speed", [this](const cles::request&, cles::json_writer&) { node.clock.advance(2ms); });
    for (int i = 0; i < 100; ++i) {
        link.ask("PULL car1:speed");
    }
    const auto samples = pull("self:cles/metrics").at("handler_us").at("samples").as_int64();
    BOOST_TEST(samples > 0);
    BOOST_TEST(samples < 100);
}

BOOST_AUTO_TEST_CASE(a_program_adds_its_own_metrics) {
    cles::test::test_node counting;
    counting.host =
        std::make_shared<cles::core::node_state>(cles::core::node_options{.name = "car1",
                                                                          .metrics =
                                                                              [](cles::json_writer& w) {
                                                                                  w.key("pool");
                                                                                  w.raw(R"({"admitted":3})");
                                                                              }},
                                                 counting.clock, [] {});
    cles::test::test_link to{counting};
    const auto all = boost::json::parse(to.ask("PULL self:cles/metrics"));
    BOOST_TEST(all.at("pool").at("admitted").as_int64() == 3);
    BOOST_TEST(all.at("handler_us").at("samples").as_int64() >= 0);
}

BOOST_AUTO_TEST_CASE(the_uptime_is_reported) {
    node.pass(2s);
    BOOST_TEST(metric("uptime_ms") == 2000);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_CASE(each_incarnation_has_its_own_epoch) { BOOST_TEST(node.host->epoch == "5f3a09c1"); }

BOOST_AUTO_TEST_CASE(a_node_without_a_log_sink_logs_nothing) {
    node.host->write_log(cles::log_level::warning, "nobody hears this");
    BOOST_TEST(link.kind("PULL self:cles") == "ok");
}

BOOST_AUTO_TEST_SUITE_END()
