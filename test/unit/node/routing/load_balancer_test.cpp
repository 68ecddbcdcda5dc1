// SPDX-License-Identifier: BSL-1.0
#include "node/routing/load_balancer.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <set>
#include <string>
#include <vector>

namespace load_balancer {
namespace {

struct fixture : cles::test::routing_fixture {
    cles::core::load_balancer::chosen choose(const std::string& line, const std::vector<std::string>& asked = {}) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request wrong;
        BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, r, wrong), wrong.why);
        return routing->choose(r, {}, asked, node.clock.now());
    }
};

} // namespace
} // namespace load_balancer

BOOST_FIXTURE_TEST_SUITE(load_balancer, fixture)

using cles::verb;

BOOST_AUTO_TEST_CASE(choice_states_whether_it_is_idempotent) {
    offer("car2", task("DELEGATE", "work", true) + "," + task("DELEGATE", "drive"));
    BOOST_TEST(choose("DELEGATE any:work").other->name == "car2");
    BOOST_TEST(choose("DELEGATE any:work").idempotent);
    BOOST_TEST(!choose("DELEGATE any:drive").idempotent);
    node.host->tasks.add(verb::push, "own", {.info = {.idempotent = true}, .plain = [](const auto&, auto&) {}});
    BOOST_TEST(choose("PUSH any:own").here);
    BOOST_TEST(choose("PUSH any:own").idempotent);
}

BOOST_AUTO_TEST_CASE(asked_node_is_not_chosen_again) {
    offer("car2", task("PULL", "speed"));
    offer("car3", task("PULL", "speed"));
    BOOST_TEST(choose("PULL any:speed", {"car2"}).other->name == "car3");
    BOOST_TEST(choose("PULL any:speed", {"car2", "car3"}).nobody());
    node.on(verb::pull, "speed", "1");
    BOOST_TEST(choose("PULL any:speed", {"car2", "car3"}).here);
    BOOST_TEST(choose("PULL any:speed", {"car2", "car3", "car1"}).nobody());
}

BOOST_AUTO_TEST_CASE(avoided_node_is_chosen_if_there_is_no_other) {
    offer("car2", task("PULL", "speed"));
    routing->find("car2")->avoid_until = node.clock.now() + std::chrono::seconds{1};
    BOOST_TEST(choose("PULL any:speed").other->name == "car2");
    node.on(verb::pull, "speed", "1");
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(choose("PULL any:speed").here);
    }
}

BOOST_AUTO_TEST_CASE(node_occupied_by_long_jobs_is_chosen_only_if_none_is_free) {
    const auto long_jobs = cles::node_load{.running = 2, .workers = 2, .service_us = 900'000};
    offer("car2", task("DELEGATE", "work"), long_jobs);
    offer("car3", task("DELEGATE", "work"), long_jobs);
    offer("car4", task("DELEGATE", "work"), {.running = 1, .workers = 2, .service_us = 2'000});
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(choose("DELEGATE any:work").other->name == "car4");
    }
    // Short jobs end soon, wherever they are.
    hear("car2", "of car2", {.running = 2, .workers = 2, .service_us = 1'000});
    std::set<std::string> chosen;
    for (int i = 0; i < 40; ++i) {
        chosen.insert(choose("DELEGATE any:work").other->name);
    }
    BOOST_TEST(chosen.contains("car2"));
    BOOST_TEST(!chosen.contains("car3"));
    // No node is free.
    hear("car2", "of car2", long_jobs);
    hear("car4", "of car4", {.queued = 9, .running = 2, .workers = 2, .service_us = 1'500'000});
    chosen.clear();
    for (int i = 0; i < 40; ++i) {
        chosen.insert(choose("DELEGATE any:work").other->name);
    }
    BOOST_TEST(chosen.size() == 2U);
    BOOST_TEST(!chosen.contains("car4"));
    // If all workers are stuck, none are left.
    hear("car3", "of car3", {.running = 2, .workers = 0, .service_us = 900'000});
    hear("car4", "of car4", {.workers = 2});
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(choose("DELEGATE any:work").other->name == "car4");
    }
}

BOOST_AUTO_TEST_CASE(own_load_is_read_for_each_choice) {
    cles::node_load own{.queued = 50};
    const auto host = std::make_shared<cles::core::node_state>(
        cles::core::node_options{.name = "hub", .epoch = 1, .load = [&own] { return own; }}, node.clock, [] {});
    const auto routes = std::make_shared<cles::core::request_router>(host, ways, 1, [] {});
    host->tasks.add(verb::pull, "speed", {.plain = [](const auto&, auto&) {}});
    host->peers.apply_announcement(
        {.node = "car2", .endpoints = {"tcp://127.0.0.1:1"}, .load = {.queued = 5}, .tasks = "d"}, 2, 1, from("car2"),
        node.clock.now());
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE(cles::protocol::parse_request("PULL any:speed", r, wrong));
    BOOST_TEST(routes->choose(r, {}, {}, node.clock.now()).other->name == "car2");
    own.queued = 0;
    BOOST_TEST(routes->choose(r, {}, {}, node.clock.now()).here);
    routes->stop();
}

BOOST_AUTO_TEST_SUITE_END()
