// SPDX-License-Identifier: BSL-1.0
// Nouns that are bound from another pool, for several members: the publisher decides for each.
#include "federation/bridge.hpp"
#include "federation/published_nouns.hpp"
#include "federation/sealed/sealed_site.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace bindings_for_requesters {
namespace {

using namespace std::chrono_literals;
using cles::bridging::bridge_link;
using cles::bridging::published_nouns;
using cles::bridging::test::sealed_site;
using cles::bridging::test::simulated_nats;

bridge_link link_of(const std::string& requester) {
    return {.what = bridge_link::role::publications, .member = requester};
}

/// hub, of the pool south, binds for its clients car1 and car2; gate is the bridge of the publisher's pool.
struct fixture {
    simulated_nats nats{1};
    cles::security::fleet_authority authority = cles::security::test::authority_with({"hub", "gate", "operator"});
    sealed_site hub{nats, authority, "south", "hub", 11};
    sealed_site gate{nats, authority, "north", "gate", 12};
    std::vector<std::string> lines; // that gate's node has received

    fixture() {
        hub->names = {"hub", "car1", "car2"};
        gate->names = {"gate", "car9"};
        hub->connect();
        gate->connect();
        nats.run_for(2s);
        BOOST_REQUIRE(hub->core().is_live("north"));
    }
    /// Each requester has a link of its own at the node, as `feed_links` has.
    std::uint64_t bind(const std::string& requester, std::uint32_t link, const std::string& noun = "car9:speed") {
        const auto id = hub->ask("north", "BIND " + noun + from(requester), link);
        nats.run_for(10ms);
        return id;
    }
    void unbind(const std::string& requester, std::uint32_t link) {
        hub->ask("north", "BIND car9:speed lease=0" + from(requester), link);
        nats.run_for(10ms);
    }
    void publish(std::uint64_t seq) {
        gate->update("car9:speed", seq);
        nats.run_for(10ms);
    }
    [[nodiscard]] std::size_t received(std::uint64_t seq) {
        return static_cast<std::size_t>(
            std::ranges::count(hub->updates, "UPDATE car9:speed seq=" + std::to_string(seq) +
                                                 " epoch=5f3a09c1 {\"n\":" + std::to_string(seq) + "}"));
    }
    [[nodiscard]] bool is_bound_for(const std::string& requester) {
        return gate->bound_on["car9:speed"].contains(link_of(requester));
    }

  private:
    static std::string from(const std::string& requester) { return requester.empty() ? "" : " from=" + requester; }
};

} // namespace
} // namespace bindings_for_requesters

BOOST_FIXTURE_TEST_SUITE(bindings_for_requesters, bindings_for_requesters::fixture)

using bindings_for_requesters::link_of;
using cles::bridging::published_nouns;
using namespace std::chrono_literals;

BOOST_AUTO_TEST_CASE(the_publisher_decides_for_each_requester) {
    gate->denied = {"car1"};
    const auto denied = bind("car1", 1);
    const auto permitted = bind("car2", 2);
    BOOST_TEST(hub->answer(denied) == R"({"error":"denied","message":"car9 does not allow it"})");
    BOOST_TEST(hub->answer(permitted) == "{}");
    publish(1);
    BOOST_TEST(received(1) == 1U);
    BOOST_TEST(!is_bound_for("car1"));
}

BOOST_AUTO_TEST_CASE(a_bridge_binds_in_its_own_name_for_itself) {
    gate->denied = {"hub"};
    BOOST_TEST(hub->answer(bind("", 1)) == R"({"error":"denied","message":"car9 does not allow it"})");
    gate->denied.clear();
    BOOST_TEST(hub->answer(bind("", 1)) == "{}");
    BOOST_TEST(is_bound_for("hub"));
}

BOOST_AUTO_TEST_CASE(each_update_is_published_once_for_all_requesters) {
    bind("car1", 1);
    bind("car2", 2);
    BOOST_REQUIRE((is_bound_for("car1") && is_bound_for("car2")));
    const auto before = nats.published("feed");
    for (std::uint64_t seq = 1; seq <= 3; ++seq) {
        publish(seq); // on both links
        BOOST_TEST(received(seq) == 2U);
    }
    BOOST_TEST(nats.published("feed") == before + 3);
    BOOST_TEST(gate->core().counted().updates_sent == 3U);
}

BOOST_AUTO_TEST_CASE(a_restart_of_the_publisher_is_passed_on_once) {
    bind("car1", 1);
    bind("car2", 2);
    const auto before = nats.published("feed");
    gate->update("car9:speed", 7, link_of("car1"));
    gate->update("car9:speed", 1, link_of("car1"), "0000cafe");
    gate->update("car9:speed", 7, link_of("car2")); // comes late
    gate->update("car9:speed", 1, link_of("car2"), "0000cafe");
    gate->update("car9:speed", 2, link_of("car2"), "0000cafe");
    BOOST_TEST(nats.published("feed") == before + 3);
}

BOOST_AUTO_TEST_CASE(what_the_publisher_ends_for_one_requester_goes_on_for_others) {
    bind("car1", 1);
    bind("car2", 2);
    gate->close(link_of("car1")); // the node has learned that car1 may not bind it any more
    nats.run_for(10ms);
    BOOST_TEST(hub->lost == std::vector<std::string>{"binding car9:speed"}, boost::test_tools::per_element());
    publish(1);
    BOOST_TEST(received(1) == 1U);
    BOOST_TEST(is_bound_for("car2"));
    BOOST_TEST(hub->core().pools().is_live(gate.id()));
    gate->denied = {"car1"};
    BOOST_TEST(hub->answer(bind("car1", 1)) == R"({"error":"denied","message":"car9 does not allow it"})");
    publish(2);
    BOOST_TEST(received(2) == 1U);
}

BOOST_AUTO_TEST_CASE(a_bind_that_waits_when_the_link_is_closed_is_unavailable) {
    gate->serves = [](const auto&, const auto&) {}; // answers nothing
    const auto id = bind("car1", 1);
    BOOST_TEST(hub->answer(id).empty());
    gate->close(link_of("car1"));
    nats.run_for(10ms);
    BOOST_TEST(hub->answer(id) == R"({"error":"unavailable","message":"the node has closed the link"})");
}

BOOST_AUTO_TEST_CASE(a_requester_that_unbinds_leaves_the_others_bound) {
    bind("car1", 1);
    bind("car2", 2);
    bind("", 3);
    unbind("car1", 1);
    BOOST_TEST(!is_bound_for("car1"));
    BOOST_TEST((is_bound_for("car2") && is_bound_for("hub")));
    BOOST_TEST((gate->ended == std::vector{link_of("car1")}));
    unbind("", 3);
    BOOST_TEST(!is_bound_for("hub"));
    BOOST_TEST(is_bound_for("car2"));
    publish(1);
    BOOST_TEST(received(1) == 1U);
    unbind("car2", 2);
    BOOST_TEST(gate->bound.empty());
    BOOST_TEST(gate->ended.size() == 3U);
}

BOOST_AUTO_TEST_CASE(a_noun_has_a_bounded_number_of_requesters) {
    for (std::uint32_t i = 0; i < published_nouns::max_requesters; ++i) {
        const auto id = bind("car" + std::to_string(100 + i), i + 1);
        BOOST_REQUIRE(hub->answer(id) == "{}");
    }
    const auto one_more = bind("car1", 1000);
    BOOST_TEST(hub->answer(one_more).starts_with(R"({"error":"busy")"), hub->answer(one_more));
    BOOST_TEST(hub->answer(bind("car100", 1001)) == "{}"); // is one of them
    unbind("car101", 2);
    BOOST_TEST(hub->answer(bind("car1", 1000)) == "{}");
}

BOOST_AUTO_TEST_SUITE_END()
