// SPDX-License-Identifier: BSL-1.0
// Nodes of different ages talk to each other: what the newer one says beyond the older one's knowledge does no harm,
// and what the older one does not say is not missed. The conversations beside this file show the same on the wire.
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <optional>
#include <string>
#include <vector>

namespace compatibility {
namespace {

// What version 1.0 of a program knows of a place, and what a later one does.
namespace then {
enum class kind { car, truck };
BOOST_DESCRIBE_ENUM(kind, car, truck)
struct place {
    double lat = 0;
    double lon = 0;
    std::optional<double> height;
};
BOOST_DESCRIBE_STRUCT(place, (), (lat, lon, height))
struct route {
    std::vector<place> places;
    kind by = kind::car;
};
BOOST_DESCRIBE_STRUCT(route, (), (places, by))
} // namespace then

namespace now {
enum class kind { car, truck, drone };
BOOST_DESCRIBE_ENUM(kind, car, truck, drone)
struct source {
    std::string name;
};
BOOST_DESCRIBE_STRUCT(source, (), (name))
struct place { // without the height, with more besides, in another order
    std::optional<std::string> name;
    double lon = 0;
    double lat = 0;
    std::optional<source> from;
    std::optional<std::vector<int>> lanes;
};
BOOST_DESCRIBE_STRUCT(place, (), (name, lon, lat, from, lanes))
struct route {
    std::vector<place> places;
    kind by = kind::car;
    std::optional<bool> toll;
};
BOOST_DESCRIBE_STRUCT(route, (), (places, by, toll))
struct strict_route { // what was to be optional and is not
    std::vector<place> places;
    bool toll = false;
};
BOOST_DESCRIBE_STRUCT(strict_route, (), (places, toll))
} // namespace now

const now::route new_route{
    .places = {{.name = "home", .lon = 11.5, .lat = 48.1, .from = now::source{"gps"}, .lanes = std::vector<int>{1, 2}},
               {.lon = 11.6, .lat = 48.2}},
    .toll = true};
const then::route old_route{.places = {{.lat = 48.1, .lon = 11.5, .height = 520}, {.lat = 48.2, .lon = 11.6}}};

struct fixture {
    /// A PUSH whose handler takes a Route and gives it back.
    template <class Route>
    std::string pushed(const std::string& body) {
        cles::test::test_node node;
        node.on(cles::verb::push, "route",
                [](const cles::request& r, cles::json_writer& w) { cles::write_json(w, r.as<Route>()); });
        cles::test::test_link link{node};
        return link.ask("PUSH car1:route " + body);
    }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace compatibility

BOOST_FIXTURE_TEST_SUITE(compatibility, fixture)

BOOST_AUTO_TEST_SUITE(structs)

BOOST_AUTO_TEST_CASE(an_old_reader_passes_over_what_a_new_writer_adds) {
    const auto read = cles::from_json<then::route>(cles::to_json(new_route));
    BOOST_REQUIRE_EQUAL(read.places.size(), 2U);
    BOOST_TEST(read.places[0].lat == 48.1);
    BOOST_TEST(read.places[0].lon == 11.5);
    BOOST_TEST(!read.places[0].height);
    BOOST_TEST(read.places[1].lat == 48.2);
}

BOOST_AUTO_TEST_CASE(a_new_reader_does_not_miss_what_an_old_writer_leaves_out) {
    const auto read = cles::from_json<now::route>(cles::to_json(old_route));
    BOOST_REQUIRE_EQUAL(read.places.size(), 2U);
    BOOST_TEST(read.places[0].lat == 48.1);
    BOOST_TEST(read.places[0].lon == 11.5);
    BOOST_TEST(!read.places[0].name);
    BOOST_TEST(!read.places[0].from);
    BOOST_TEST(!read.places[0].lanes);
    BOOST_TEST(!read.toll);
}

BOOST_AUTO_TEST_CASE(null_says_the_same_as_nothing) {
    const auto read = cles::from_json<now::place>("{\"name\":null,\"lat\":1,\"lon\":2,\"from\":null,\"lanes\":null}");
    BOOST_TEST(!read.name);
    BOOST_TEST(!read.lanes);
}

BOOST_AUTO_TEST_CASE(what_is_required_and_missing_is_named) {
    BOOST_TEST(pushed<now::strict_route>(cles::to_json(old_route)).find("toll: is missing") != std::string::npos);
    BOOST_TEST(pushed<then::route>("{\"places\":[{\"lat\":1}],\"by\":\"car\"}").find("places[0].lon: is missing") !=
               std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_name_that_an_old_reader_does_not_know_is_told_with_those_that_it_knows) {
    auto flown = new_route;
    flown.by = now::kind::drone;
    const auto answer = pushed<then::route>(cles::to_json(flown));
    BOOST_TEST(answer.starts_with("{\"error\":\"bad_request\""));
    BOOST_TEST(answer.find("by: expected one of car, truck") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(what_does_not_fit_where_it_is_known_is_refused_however_new) {
    BOOST_TEST(pushed<then::route>("{\"places\":[{\"lat\":1,\"lon\":\"2 E\"}],\"by\":\"car\"}")
                   .find("places[0].lon: expected a number, got a string") != std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(requests)

BOOST_AUTO_TEST_CASE(an_old_node_serves_a_new_client) {
    BOOST_TEST(pushed<then::route>(cles::to_json(new_route)) ==
               "{\"places\":[{\"lat\":48.1,\"lon\":11.5},{\"lat\":48.2,\"lon\":11.6}],\"by\":\"car\"}\n");
}

BOOST_AUTO_TEST_CASE(a_new_node_serves_an_old_client) {
    BOOST_TEST(pushed<now::route>(cles::to_json(old_route)) ==
               "{\"places\":[{\"lon\":11.5,\"lat\":48.1},{\"lon\":11.6,\"lat\":48.2}],\"by\":\"car\"}\n");
}

BOOST_AUTO_TEST_CASE(adverbs_of_a_later_version_are_passed_over_on_every_verb) {
    node.on(cles::verb::pull, "speed", "{\"v\":3}");
    node.on(cles::verb::push, "speed", "{}");
    node.on(cles::verb::delegate, "speed", "[1]");
    node.on(cles::verb::update, "speed", "{}");
    BOOST_TEST(link.kind("PULL car1:speed id=1 priority=high") == "id=1 ok");
    BOOST_TEST(link.kind("PUSH car1:speed priority=high id=2 trace=00-4bf9-01 {}") == "id=2 ok");
    BOOST_TEST(link.kind("DELEGATE car1:speed id=3 region=eu,us") == "id=3 ok");
    BOOST_TEST(link.kind("BIND car1:speed id=4 only_when=moving") == "id=4 ok");
    BOOST_TEST(link.kind("UPDATE car1:speed id=5 ttl=3 {}") == "id=5 ok");
}

BOOST_AUTO_TEST_CASE(what_must_be_understood_is_refused_on_every_verb) {
    for (const auto verb : cles::verb_names) {
        BOOST_TEST(link.kind(std::string{verb} + " car1:speed id=1 must_encrypt=yes") == "id=1 bad_request", verb);
    }
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(replies)

BOOST_AUTO_TEST_CASE(an_old_client_reads_a_new_nodes_answer) {
    std::vector<std::string> told;
    auto state = cles::test::told_reply::state::waiting;
    const auto ask = [&](std::uint64_t id) {
        const auto now = node.clock.now();
        link.session().asking().send({.verb = cles::verb::pull, .noun = "car2:speed", .id = id},
                                     now + std::chrono::seconds{5}, now,
                                     cles::detail::pending_ptr{new cles::test::told_reply(
                                         id, state, [&](const std::string& what) { told.push_back(what); })});
    };
    ask(1);
    ask(2);
    ask(3);
    link.ask("id=1 cost=3 served_by=car9 {\"v\":1,\"confidence\":0.9}");
    link.ask("id=2 retry=never {\"error\":\"quarantined\",\"message\":\"x\",\"until\":\"noon\"}");
    link.ask("id=3 {\"error\":\"busy\",\"message\":\"x\",\"retry_ms\":\"soon\",\"queue\":[1,{}]}");
    const std::vector<std::string> expected{"1 ok {\"v\":1,\"confidence\":0.9}", "2 failed failed", "3 failed busy"};
    BOOST_TEST(told == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_old_binder_reads_a_new_nodes_updates) {
    std::vector<std::string> told;
    cles::test::told_feed feed{"car2", "speed", false, [&](const std::string& what) { told.push_back(what); }};
    BOOST_TEST(link.session().bound().add(feed));
    link.ask("UPDATE car2:speed seq=1 epoch=00000001 origin=gps {\"v\":1,\"unit\":\"m/s\"}");
    link.ask("UPDATE car2:speed origin=gps epoch=00000001 seq=2 {\"v\":2}");
    const std::vector<std::string> expected{"update car2:speed 1 {\"v\":1,\"unit\":\"m/s\"}",
                                            "update car2:speed 2 {\"v\":2}"};
    BOOST_TEST(told == expected, boost::test_tools::per_element());
    link.session().bound().remove(feed);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
