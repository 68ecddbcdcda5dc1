// SPDX-License-Identifier: BSL-1.0
// What a node forwards in a fleet, and what others accept from it (docs/protocol_security.md, "Forwarded requests").
#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "security/raw_member.hpp"
#include "security/secured_services.hpp"

#include <boost/test/unit_test.hpp>

#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace forwarding {
namespace {

using namespace cles::security::test;

/// What a handler sees of who asks: "peer requester forwarder".
std::string who(const cles::request& r) {
    return r.peer().name + " " + std::string{r.requester()} + " " + std::string{r.forwarded_by()};
}

/// sat1 asks car1 through hub.
struct fixture {
    fixture() { fleet.add("sat1"); }

    /// car1 has these rules, and hub forwards for these.
    void start_car1(std::vector<std::string> forwards, const std::string& rules = {}) {
        fleet.add("hub", {.forwards = std::move(forwards)});
        fleet.add("car1");
        std::ofstream{fleet.directory_of("car1") + "/rules"} << rules;
        auto options = fleet.options("car1");
        options.gossip = cles::gossip();
        car1.emplace(io, std::move(options));
        car1->on_push("poke", [this](const cles::request& r) { pokes.push_back(who(r)); });
        car1->on_pull("count", [] { return 1; });
    }
    void start(std::vector<std::string> forwards, const std::string& rules = {}) {
        start_car1(std::move(forwards), rules);
        auto options = fleet.knowing("hub", *car1);
        options.routing = cles::routing();
        options.gossip = cles::gossip({car1->endpoints().front()});
        hub.emplace(io, std::move(options));
        cles::test::run_until(io, [this] { return !hub->peers().empty(); });
        sat1.emplace(io, fleet.options("sat1"));
    }
    [[nodiscard]] std::string ask_hub(const std::string& command) {
        std::optional<std::string> found;
        std::string why;
        sat1->async_request(command, cles::call_options{}.at(hub->endpoints().front()).diagnostics(why),
                            [&](boost::system::error_code code, const cles::json_text& reply) {
                                found = code ? code.message() + ": " + why : reply.text;
                            });
        cles::test::run_until(io, [&] { return found.has_value(); });
        return *found;
    }

    secured_fleet fleet{};
    boost::asio::io_context io;
    std::optional<cles::service> car1;
    std::optional<cles::service> hub;
    std::optional<cles::service> sat1;
    std::vector<std::string> pokes;
};

} // namespace
} // namespace forwarding

BOOST_FIXTURE_TEST_SUITE(forwarding, fixture)

BOOST_AUTO_TEST_CASE(a_node_without_the_right_forwards_by_no_target) {
    start({});
    for (const std::string target : {"car1", "any", "all"}) {
        BOOST_TEST_CONTEXT(target) {
            const auto told = ask_hub("PUSH " + target + ":poke");
            BOOST_TEST(contains(told, "hub may not forward requests of sat1"), told);
        }
    }
    BOOST_TEST(pokes.empty());
}

BOOST_AUTO_TEST_CASE(the_rules_of_the_target_are_about_the_requester) {
    start({"*"}, "deny sat1 may push *:poke\n");
    for (const std::string target : {"car1", "any", "all"}) {
        const auto told = ask_hub("PUSH " + target + ":poke");
        BOOST_TEST(contains(told, "car1 does not allow PUSH 'poke'"), told);
    }
    BOOST_TEST(pokes.empty());
    BOOST_TEST(ask_hub("PULL all:count") == R"({"results":{"car1":{"value":1}},"errors":{}})");
}

BOOST_AUTO_TEST_CASE(a_handler_knows_the_requester_and_the_forwarder) {
    start({"*"});
    for (const std::string target : {"car1", "any", "all"}) {
        const auto told = ask_hub("PUSH " + target + ":poke");
        BOOST_TEST(!contains(told, "denied"), told);
    }
    BOOST_TEST(ask(io, *car1, "PUSH self:poke") == "{}");
    const std::string forwarded = "hub sat1 hub";
    BOOST_TEST(pokes == (std::vector<std::string>{forwarded, forwarded, forwarded, " car1 "}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_member_that_states_another_without_the_right_is_denied) {
    start_car1({"sat*"});
    const auto by = raw_member::connect(io, fleet, "hub", *car1);
    BOOST_TEST(contains(by->ask("PUSH car1:poke id=7 from=car1"), "denied"));
    BOOST_TEST(contains(by->ask("PUSH car1:poke id=7 from=nobody"), "'nobody', the requester that is stated"));
    BOOST_TEST(pokes.empty());
    BOOST_TEST(by->ask("PUSH car1:poke id=7 from=sat1") == "{}");
    by->close();
}

BOOST_AUTO_TEST_CASE(the_target_as_the_stated_requester_has_its_rights_in_the_roster) {
    start_car1({"*"}, "deny car1 may push *:poke\n");
    const auto by = raw_member::connect(io, fleet, "hub", *car1);
    BOOST_TEST(contains(by->ask("PUSH car1:poke id=7 from=car1"), "denied"));
    BOOST_TEST(pokes.empty());
    BOOST_TEST(ask(io, *car1, "PUSH self:poke") == "{}");
    by->close();
}

BOOST_AUTO_TEST_SUITE_END()
