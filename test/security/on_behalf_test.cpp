// SPDX-License-Identifier: BSL-1.0
// What a program asks on behalf of members of its fleet (call_options::on_behalf_of).
#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "security/secured_services.hpp"
#include "support/feed_log.hpp"

#include <boost/test/unit_test.hpp>

#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace on_behalf {
namespace {

using namespace cles::security::test;

std::string who(const cles::request& r) {
    return r.peer().name + " " + std::string{r.requester()} + " " + std::string{r.forwarded_by()};
}

/// hub asks car1, also on behalf of sat1.
struct fixture {
    fixture() { fleet.add("sat1"); }

    /// hub may forward for these members, and car1 has these rules.
    void start(std::vector<std::string> forwards, const std::string& rules = {}) {
        fleet.add("hub", {.forwards = std::move(forwards)});
        fleet.add("car1");
        std::ofstream{fleet.directory_of("car1") + "/rules"} << rules;
        auto served = fleet.options("car1");
        served.gossip = cles::gossip();
        car1.emplace(io, std::move(served));
        car1->on_push("poke", [this](const cles::request& r) { pokes.push_back(who(r)); });
        auto options = fleet.knowing("hub", *car1);
        options.routing = cles::routing();
        options.gossip = cles::gossip({car1->endpoints().front()});
        hub.emplace(io, std::move(options));
        hub->on_push("poke", [this](const cles::request& r) { pokes.push_back(who(r)); });
        cles::test::run_until(io, [this] { return !hub->peers().empty(); });
    }
    [[nodiscard]] std::string ask_with(const std::string& command, cles::call_options options) {
        std::optional<std::string> found;
        std::string why;
        hub->async_request(command, options.diagnostics(why),
                           [&](boost::system::error_code code, const cles::json_text& reply) {
                               found = code ? code.message() + ": " + why : reply.text;
                           });
        cles::test::run_until(io, [&] { return found.has_value(); });
        return *found;
    }
    [[nodiscard]] std::string ask_for(const std::string& member, const std::string& command) {
        return ask_with(command, cles::call_options{}.on_behalf_of(member));
    }

    secured_fleet fleet{};
    boost::asio::io_context io;
    std::optional<cles::service> car1;
    std::optional<cles::service> hub;
    std::vector<std::string> pokes;
};

} // namespace
} // namespace on_behalf

BOOST_FIXTURE_TEST_SUITE(on_behalf, fixture)

BOOST_AUTO_TEST_CASE(the_member_is_the_requester_on_each_way) {
    start({"sat*"});
    BOOST_TEST(ask_for("sat1", "PUSH car1:poke") == "{}");
    BOOST_TEST(ask_for("sat1", "PUSH hub:poke") == "{}");
    BOOST_TEST(!contains(ask_for("sat1", "PUSH any:poke"), "denied"));
    BOOST_TEST(ask_for("sat1", "PUSH all:poke") == R"({"results":{"car1":{},"hub":{}},"errors":{}})");
    BOOST_REQUIRE(pokes.size() == 5U);
    for (const auto& each : pokes) {
        BOOST_TEST(contains(each, " sat1 hub"), each);
    }
    BOOST_TEST(ask(io, *hub, "PUSH car1:poke") == "{}");
    BOOST_TEST(pokes.back() == "hub hub ");
}

BOOST_AUTO_TEST_CASE(without_the_right_to_forward_nothing_leaves) {
    start({"car*"});
    for (const std::string target : {"car1", "any", "all", "hub"}) {
        BOOST_TEST_CONTEXT(target) {
            const auto told = ask_for("sat1", "PUSH " + target + ":poke");
            BOOST_TEST(contains(told, "hub may not forward requests of sat1"), told);
        }
    }
    BOOST_TEST(pokes.empty());
}

BOOST_AUTO_TEST_CASE(the_rules_of_the_target_are_about_the_member) {
    start({"*"}, "deny sat1 may push *:poke\n");
    BOOST_TEST(contains(ask_for("sat1", "PUSH car1:poke"), "car1 does not allow PUSH 'poke'"));
    BOOST_TEST(pokes.empty());
    BOOST_TEST(ask(io, *hub, "PUSH car1:poke") == "{}");
}

BOOST_AUTO_TEST_CASE(what_cannot_be_asked_is_refused) {
    start({"*"});
    BOOST_TEST(contains(ask_for("nobody", "PUSH car1:poke"), "'nobody', the requester that is stated"));
    for (const std::string name : {"a b", ""}) {
        BOOST_TEST(contains(ask_for(name, "PUSH car1:poke"), "must be the name of a member"), name);
    }
    const auto at = car1->endpoints().front();
    BOOST_TEST(contains(ask_with("PUSH car1:poke", cles::call_options{}.on_behalf_of("sat1").at(at)), "together"));
    // It would cancel what others have asked on the same link.
    for (const std::string target : {"self", "hub", "car1"}) {
        BOOST_TEST(contains(ask_for("sat1", "PUSH " + target + ":cles/cancel/1"), "only PULL"), target);
    }
    cles::test::feed_log feed;
    feed.bind(*hub, "car1:position", cles::bind_options{}.on_behalf_of("sat1").multicast());
    cles::test::run_until(io, [&] { return feed.binds == 1; });
    BOOST_TEST(!feed.bound);
    BOOST_TEST(pokes.empty());
}

BOOST_AUTO_TEST_CASE(a_node_without_security_refuses_all_of_it) {
    cles::service plain{io, {.name = "plain", .routing = cles::routing()}};
    std::string why;
    bool ended = false;
    plain.async_pull("self:cles", cles::call_options{}.on_behalf_of("sat1").diagnostics(why),
                     [&](boost::system::error_code code, const cles::json_text&) {
                         BOOST_TEST((code == cles::errc::denied));
                         ended = true;
                     });
    cles::test::run_until(io, [&] { return ended; });
    BOOST_TEST(contains(why, "has no security"), why);
}

BOOST_AUTO_TEST_CASE(a_binding_ends_with_the_right_of_the_member) {
    start({"*"});
    car1->update("position", 1);
    cles::test::feed_log of_member;
    cles::test::feed_log own;
    of_member.bind(*hub, "car1:position", cles::bind_options{}.on_behalf_of("sat1"));
    own.bind(*hub, "car1:position");
    cles::test::run_until(io, [&] { return !of_member.items.empty() && !own.items.empty(); });
    car1->update("position", 2);
    cles::test::run_until(io, [&] { return of_member.bodies().size() == 1 && own.bodies().size() == 1; });

    fleet.authority.set_rights("sat1", {.may = std::vector<std::string>{"pull *:*"}});
    BOOST_TEST(ask(io, *hub, "PUSH self:cles/roster " + fleet.authority.newest().line()) == "{}");
    cles::test::run_until(io, [&] { return of_member.items.back().kind == cles::feed_event::lost; });
    car1->update("position", 3);
    cles::test::run_until(io, [&] { return own.bodies().size() == 2; });
    BOOST_TEST(of_member.bodies().size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
