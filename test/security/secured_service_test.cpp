// SPDX-License-Identifier: BSL-1.0
#include <cles/routing.hpp>

#include "security/secured_services.hpp"
#include "support/feed_log.hpp"
#include "support/group_address.hpp"
#include "support/group_repeater.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace secured_service {
namespace {

using namespace cles::security::test;
using cles::errc;

struct fixture {
    /// car1 serves, car2 asks.
    fixture() {
        car1.on_pull("speed", [] { return 7; });
        car1.on_push("note", [](const std::string&) {});
    }

    void offer(cles::service& to) {
        const auto& line = fleet.authority.newest().line();
        BOOST_TEST(ask(io, to, "PUSH self:cles/roster " + line) == "{}");
    }
    [[nodiscard]] static std::uint64_t version_of(boost::asio::io_context& io, cles::service& node) {
        const auto described = ask(io, node, "PULL self:cles");
        const auto at = described.find("\"roster\":");
        return at == std::string::npos ? 0 : std::stoull(described.substr(at + 9));
    }

    std::uint64_t count_of(cles::service& node, const std::string& counter) {
        const auto all = ask(io, node, "PULL self:cles/metrics");
        const auto at = all.find("\"" + counter + "\":");
        return at == std::string::npos ? 0 : std::stoull(all.substr(at + counter.size() + 3));
    }

    boost::asio::io_context io;
    secured_fleet fleet{"car1", "car2"};
    cles::service car1{io, fleet.options("car1")};
    cles::service car2{io, fleet.knowing("car2", car1)};
};

const std::string speed = "{\"value\":7}";

bool is_denied(const std::string& outcome) {
    return contains(outcome, "does not allow") || contains(outcome, "may not");
}

} // namespace
} // namespace secured_service

BOOST_FIXTURE_TEST_SUITE(secured_service, fixture)

BOOST_AUTO_TEST_CASE(members_reach_each_other) {
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    BOOST_TEST(car1.endpoints().front().starts_with("tls://127.0.0.1:"));
}

BOOST_AUTO_TEST_CASE(a_handler_sees_who_asks) {
    std::string name;
    std::string transport;
    car1.on_pull("who", [&](const cles::request& r) {
        name = r.peer().name;
        transport = r.peer().transport;
        return 1;
    });
    BOOST_TEST(ask(io, car2, "PULL car1:who") == "{\"value\":1}");
    BOOST_TEST(name == "car2");
    BOOST_TEST(transport == "tls");
}

BOOST_AUTO_TEST_CASE(updates_arrive) {
    car1.update("pose", 1);
    cles::test::feed_log feed;
    feed.bind(car2, "car1:pose");
    cles::test::run_until(io, [&] { return !feed.items.empty(); });
    BOOST_TEST(feed.items.front().value.text == "{\"value\":1}");
}

BOOST_AUTO_TEST_CASE(a_key_that_is_not_in_the_roster_is_refused) {
    secured_fleet other{"car3"};
    cles::service car3{io, other.knowing("car3", car1)};
    BOOST_TEST(ask(io, car3, "PULL car1:speed") != speed);
    // It passes for car2 in a roster of its own.
    secured_fleet forged{"car1", "car2"};
    cles::service impostor{io, forged.knowing("car2", car1)};
    const auto outcome = ask(io, impostor, "PULL car1:speed");
    BOOST_TEST(contains(outcome, "cannot connect"), outcome);
}

BOOST_AUTO_TEST_CASE(another_member_does_not_pass_for_the_one_that_is_meant) {
    fleet.add("car3");
    offer(car1);
    auto options = fleet.options("car3");
    options.peers.emplace("car2", car1.endpoints().front());
    cles::service car3{io, std::move(options)};
    const auto outcome = ask(io, car3, "PULL car2:speed");
    BOOST_TEST(contains(outcome, "cannot connect"), outcome);
}

BOOST_AUTO_TEST_CASE(at_an_address_only_the_node_that_is_stated_may_answer) {
    const auto where = car1.endpoints().front();
    const auto outcome = [&](const std::string& command, const std::string& node) {
        std::string why;
        std::optional<boost::system::error_code> code;
        car2.async_request(command, cles::call_options{}.at(where, node).diagnostics(why),
                           [&](boost::system::error_code failed, const cles::json_text&) { code = failed; });
        cles::test::run_until(io, [&] { return code.has_value(); });
        return *code ? code->message() + ": " + why : std::string{};
    };
    for (const std::string node : {"", "car1"}) {
        BOOST_TEST(outcome("PULL self:speed", node) == "");
    }
    // A node that asks the one whose key it uses: the name alone would lead to itself.
    const auto other = outcome("PULL car2:speed", "car2");
    BOOST_TEST(contains(other, "cannot connect"), other);
    BOOST_TEST(outcome("PULL self:speed", "car1") == "");
}

BOOST_AUTO_TEST_CASE(plain_links_are_refused) {
    BOOST_CHECK_EXCEPTION(car1.listen("tcp://127.0.0.1:0"), cles::error,
                          [](const cles::error& e) { return e.code() == errc::insecure_listen; });
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    std::string why;
    std::optional<boost::system::error_code> code;
    car2.async_request("PULL self:cles", cles::call_options{}.at("tcp://127.0.0.1:1").diagnostics(why),
                       [&](boost::system::error_code failed, const cles::json_text&) { code = failed; });
    cles::test::run_until(io, [&] { return code.has_value(); });
    BOOST_TEST((*code == errc::denied));
    BOOST_TEST(contains(why, "use 'tls'"), why);
}

BOOST_AUTO_TEST_CASE(the_name_must_be_that_of_the_key) {
    auto options = fleet.options("car1");
    options.name = "car9";
    BOOST_CHECK_EXCEPTION((cles::service{io, std::move(options)}), cles::error,
                          [](const cles::error& e) { return e.code() == errc::invalid_name; });
}

BOOST_AUTO_TEST_CASE(a_security_is_for_one_service) {
    auto options = fleet.options("car2");
    options.listen.clear();
    auto again = options;
    const cles::service one{io, std::move(options)};
    BOOST_CHECK_EXCEPTION((cles::service{io, std::move(again)}), cles::error,
                          [](const cles::error& e) { return e.code() == errc::invalid_option; });
}

BOOST_AUTO_TEST_CASE(unusable_files_are_named) {
    BOOST_CHECK_EXCEPTION(cles::secured(fleet.directory_of("nobody")), cles::error, [&](const cles::error& e) {
        return e.code() == errc::denied && contains(e.message(), fleet.directory_of("nobody"));
    });
}

BOOST_AUTO_TEST_SUITE(rights)

BOOST_AUTO_TEST_CASE(they_change_without_a_restart) {
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    fleet.authority.set_rights("car2", {.may = std::vector<std::string>{"push *:note"}});
    offer(car1);
    const auto outcome = ask(io, car2, "PULL car1:speed");
    BOOST_TEST(is_denied(outcome), outcome);
    BOOST_TEST(ask(io, car2, "PUSH car1:note {\"value\":\"hi\"}") == "{}");
    fleet.authority.set_rights("car2", {});
    offer(car1);
    cles::test::run_until(io, [&] { return ask(io, car2, "PULL car1:speed") == speed; }); // car2 is told of it, too
}

BOOST_AUTO_TEST_CASE(local_rules_narrow_them_within_a_second) {
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    std::ofstream{fleet.directory_of("car1") + "/rules"} << "deny car2 may pull *:speed\n";
    cles::test::run_until(io, [&] { return is_denied(ask(io, car2, "PULL car1:speed")); });
    std::ofstream{fleet.directory_of("car1") + "/rules"} << "nonsense\n";
    cles::test::run_until(io, [&] { return is_denied(ask(io, car2, "PUSH car1:note {\"value\":\"hi\"}")); });
    std::filesystem::remove(fleet.directory_of("car1") + "/rules");
    cles::test::run_until(io, [&] { return ask(io, car2, "PULL car1:speed") == speed; });
}

BOOST_AUTO_TEST_CASE(a_binding_ends_with_the_right_to_it) {
    car1.update("pose", 1);
    cles::test::feed_log feed;
    feed.bind(car2, "car1:pose");
    cles::test::run_until(io, [&] { return !feed.items.empty(); });
    fleet.authority.set_rights("car2", {.may = std::vector<std::string>{"pull *:speed"}});
    offer(car1);
    cles::test::run_until(io, [&] { return feed.items.back().kind == cles::feed_event::lost; });
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(rosters)

BOOST_AUTO_TEST_CASE(a_newer_one_spreads_over_open_links) {
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    fleet.with_newest = false;
    fleet.add("car3");
    offer(car1);
    cles::test::run_until(io, [&] { return version_of(io, car2) == fleet.authority.newest().version(); });
    // It is stored, too.
    std::vector<std::string> warnings;
    BOOST_TEST(cles::security::key_directory{fleet.directory_of("car2")}.read_newest_roster(warnings)->version() ==
               fleet.authority.newest().version());
}

BOOST_AUTO_TEST_CASE(a_new_member_brings_it_along) {
    fleet.with_newest = false;
    fleet.add("car3");
    cles::service car3{io, fleet.knowing("car3", car1)};
    BOOST_TEST(ask(io, car3, "PULL car1:speed") == speed);
    BOOST_TEST(version_of(io, car1) == fleet.authority.newest().version());
}

BOOST_AUTO_TEST_CASE(one_that_is_copied_to_the_directory_is_adopted) {
    fleet.with_newest = false;
    fleet.add("car3");
    cles::security::key_directory{fleet.directory_of("car1")}.write_join("car1", fleet.authority.newest());
    cles::test::run_until(io, [&] { return version_of(io, car1) == fleet.authority.newest().version(); });
}

BOOST_AUTO_TEST_CASE(a_removed_member_gets_nothing) {
    BOOST_TEST(ask(io, car2, "PULL car1:speed") == speed);
    fleet.authority.remove("car2");
    offer(car1);
    cles::test::run_until(io, [&] { return ask(io, car2, "PULL car1:speed") != speed; });
    for (int i = 0; i < 5; ++i) {
        BOOST_TEST(ask(io, car2, "PULL car1:speed") != speed);
    }
}

BOOST_AUTO_TEST_CASE(a_bad_one_changes_nothing) {
    const auto before = version_of(io, car1);
    BOOST_TEST(contains(ask(io, car1, "PUSH self:cles/roster {\"signature\":\"x\",\"roster\":{}}"), "roster"));
    BOOST_TEST(version_of(io, car1) == before);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(group)

BOOST_AUTO_TEST_CASE(members_discover_each_other) {
    const auto where = cles::test::fresh_group();
    fleet.add("sat1");
    fleet.add("sat2");
    auto first = fleet.options("sat1");
    first.multicast = where;
    auto second = fleet.options("sat2");
    second.multicast = where;
    cles::service sat1{io, std::move(first)};
    cles::service sat2{io, std::move(second)};
    sat1.on_pull("power", [] { return 3; });
    cles::test::run_until(io, [&] { return ask(io, sat2, "PULL sat1:power") == "{\"value\":3}"; });
    cles::test::run_until(io, [&] { return contains(ask(io, sat1, "PULL self:cles/peers"), "sat2"); });
}

BOOST_AUTO_TEST_CASE(others_are_not_heard_and_hear_nothing) {
    const auto where = cles::test::fresh_group();
    fleet.add("sat1");
    auto first = fleet.options("sat1");
    first.multicast = where;
    cles::service sat1{io, std::move(first)};
    cles::service plain{io, {.name = "plain", .listen = {"tcp://127.0.0.1:0"}, .multicast = where}};
    secured_fleet others{"spy"};
    auto foreign = others.options("spy");
    foreign.multicast = where;
    cles::service spy{io, std::move(foreign)};
    fleet.add("sat2");
    auto second = fleet.options("sat2");
    second.multicast = where;
    cles::service sat2{io, std::move(second)};
    cles::test::run_until(io, [&] { return contains(ask(io, sat1, "PULL self:cles/peers"), "sat2"); });
    const auto known = ask(io, sat1, "PULL self:cles/peers");
    BOOST_TEST(!contains(known, "plain"), known);
    BOOST_TEST(!contains(known, "spy"), known);
    for (auto* outsider : {&plain, &spy}) {
        const auto seen = ask(io, *outsider, "PULL self:cles/peers");
        BOOST_TEST(!contains(seen, "sat"), seen);
    }
}

BOOST_AUTO_TEST_CASE(what_a_stranger_repeats_takes_no_name_away) {
    const auto where = cles::test::fresh_group();
    fleet.add("sat1");
    fleet.add("sat2");
    auto first = fleet.options("sat1");
    first.multicast = where;
    auto second = fleet.options("sat2");
    second.multicast = where;
    second.routing = cles::routing();
    cles::test::group_repeater stranger{io, where};
    cles::service sat1{io, std::move(first)};
    cles::service sat2{io, std::move(second)};
    sat1.on_pull("power", [] { return 3; });
    cles::test::run_until(io, [&] { return ask(io, sat2, "PULL sat1:power") == "{\"value\":3}"; });
    for (int round = 0; round < 3; ++round) {
        const auto heard = stranger.heard();
        const auto copies = count_of(sat2, "group_copied");
        cles::test::run_until(io, [&] { return stranger.heard() > heard + 2; });
        stranger.repeat_all();
        cles::test::run_until(io, [&] { return count_of(sat2, "group_copied") > copies + 1; });
        BOOST_TEST(ask(io, sat2, "PULL sat1:power") == "{\"value\":3}");
        BOOST_TEST(ask(io, sat2, "PULL any:power") == "{\"value\":3}");
        BOOST_TEST(ask(io, sat2, "PULL all:power") == "{\"results\":{\"sat1\":{\"value\":3}},\"errors\":{}}");
    }
    BOOST_TEST(sat2.peers().size() == 1U);
    BOOST_TEST(sat1.peers().size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_that_restarts_is_heard_again) {
    const auto where = cles::test::fresh_group();
    fleet.add("sat1");
    fleet.add("sat2");
    auto first = fleet.options("sat1");
    first.multicast = where;
    cles::service sat1{io, std::move(first)};
    for (int incarnation = 1; incarnation <= 3; ++incarnation) {
        auto second = fleet.options("sat2");
        second.multicast = where;
        cles::service sat2{io, std::move(second)};
        sat2.on_pull("incarnation", [incarnation] { return incarnation; });
        cles::test::run_until(io, [&] {
            return ask(io, sat1, "PULL sat2:incarnation") == "{\"value\":" + std::to_string(incarnation) + "}";
        });
    }
}

BOOST_AUTO_TEST_CASE(updates_are_received_through_it) {
    const auto where = cles::test::fresh_group();
    fleet.add("sat1");
    fleet.add("sat2");
    auto first = fleet.options("sat1");
    first.multicast = where;
    cles::service sat1{io, std::move(first)};
    auto second = fleet.options("sat2");
    second.multicast = where;
    cles::service sat2{io, std::move(second)};
    cles::test::feed_log feed;
    feed.bind(sat2, "all:pose", cles::bind_options{}.multicast());
    int value = 0;
    cles::test::run_until(io, [&] {
        sat1.update("pose", ++value);
        return feed.items.size() > 10;
    });
    BOOST_TEST(feed.bound);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
