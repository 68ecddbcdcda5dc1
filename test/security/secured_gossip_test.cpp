// SPDX-License-Identifier: BSL-1.0
// A fleet without multicast: its nodes know each other by gossip over `tls` only (docs/protocol_security.md,
// "Announcements").
#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "security/keys/signed_text.hpp"
#include "security/secured_services.hpp"
#include "support/feed_log.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace secured_gossip {
namespace {

using namespace cles::security::test;

/// Each node is on a context of its own: on one, they would reach each other without links.
struct fixture {
    fixture() {
        fleet.add("car1", {.forwards = {"*"}});
        fleet.add("car2");
        fleet.add("car3");
    }

    /// Options of a node that first asks those others.
    [[nodiscard]] cles::service_options gossiping(const std::string& name,
                                                  const std::vector<const cles::service*>& seeds = {}) const {
        auto made = fleet.options(name);
        std::vector<std::string> urls;
        for (const auto* each : seeds) {
            urls.push_back(each->endpoints().front());
        }
        made.gossip = cles::gossip(std::move(urls));
        return made;
    }
    template <class Condition>
    void wait(Condition&& holds) {
        cles::test::run_until(contexts[0], [&] {
            for (auto& each : contexts) {
                each.restart();
                each.poll();
            }
            return holds();
        });
    }
    std::string ask(cles::service& by, const std::string& command) {
        std::optional<std::string> found;
        std::string why;
        by.async_request(command, cles::call_options{}.diagnostics(why),
                         [&](boost::system::error_code code, const cles::json_text& reply) {
                             found = code ? code.message() + ": " + why : reply.text;
                         });
        wait([&] { return found.has_value(); });
        return *found;
    }
    std::string known_to(cles::service& node) { return ask(node, "PULL self:cles/peers"); }
    /// An entry of gossip, signed by that member.
    [[nodiscard]] std::string entry_of(const std::string& by, const std::string& said) const {
        const auto own = cles::security::key_directory{fleet.directory_of(by)}.read_node();
        const cles::security::signed_update update{
            .publisher = "car3", .noun = "cles", .seq = 1, .epoch = "0000000b", .body = said};
        return R"({"announced":)" + said + R"(,"seq":1,"epoch":"0000000b","sig":")" +
               cles::security::sign(own.own.key, own.newest->fleet(), update) + R"(","age_ms":0,"state":"live"})";
    }
    std::uint64_t number_in(const std::string& reply, const std::string& name) {
        const auto at = reply.find("\"" + name + "\":");
        return at == std::string::npos ? 0 : std::stoull(reply.substr(at + name.size() + 3));
    }
    std::uint64_t dropped_by(cles::service& node) {
        return number_in(ask(node, "PULL self:cles/metrics"), "entries_dropped");
    }
    std::uint64_t version_of(cles::service& node) { return number_in(ask(node, "PULL self:cles"), "roster"); }

    std::array<boost::asio::io_context, 4> contexts;
    secured_fleet fleet{};
};

} // namespace
} // namespace secured_gossip

BOOST_FIXTURE_TEST_SUITE(secured_gossip, fixture)

BOOST_AUTO_TEST_CASE(members_find_each_other) {
    cles::service car1{contexts[0], gossiping("car1")};
    cles::service car2{contexts[1], gossiping("car2", {&car1})};
    cles::service car3{contexts[2], gossiping("car3", {&car1})};
    const std::array<cles::service*, 3> all{&car1, &car2, &car3};
    for (auto* each : all) {
        each->on_pull("name", [name = each->name()] { return name; });
    }
    for (auto* by : all) {
        for (auto* other : all) {
            if (by != other) {
                wait([&] {
                    return ask(*by, "PULL " + other->name() + ":name") == "{\"value\":\"" + other->name() + "\"}";
                });
            }
        }
    }
    for (auto* each : all) {
        BOOST_TEST(dropped_by(*each) == 0U);
    }
}

BOOST_AUTO_TEST_CASE(an_entry_that_its_node_has_not_signed_is_dropped) {
    cles::service car1{contexts[0], gossiping("car1")};
    cles::service car2{contexts[1], fleet.knowing("car2", car1)};
    const std::string said = R"({"node":"car3","endpoints":["tls://127.0.0.1:1"]})";
    const auto send = [&](const std::string& entry) {
        BOOST_TEST(ask(car2, R"(PUSH car1:cles/peers {"peers":[)" + entry + "]}") == "{}");
    };
    send(R"({"node":"car3","endpoints":["tls://127.0.0.1:1"],"epoch":"0000000b","seq":1,"age_ms":0})");
    send(entry_of("car2", said));
    BOOST_TEST(dropped_by(car1) == 2U);
    BOOST_TEST(!contains(known_to(car1), "car3"));
    send(entry_of("car3", said));
    BOOST_TEST(dropped_by(car1) == 2U);
    BOOST_TEST(contains(known_to(car1), "car3"));
}

BOOST_AUTO_TEST_CASE(a_node_leaves_and_returns) {
    cles::service car1{contexts[0], gossiping("car1")};
    cles::service car2{contexts[1], gossiping("car2", {&car1})};
    {
        cles::service car3{contexts[2], gossiping("car3", {&car2})};
        wait([&] { return contains(known_to(car1), "car3"); });
        car3.leave();
        wait([&] { return !contains(known_to(car1), "car3"); });
    }
    cles::service again{contexts[3], gossiping("car3", {&car2})};
    again.on_pull("speed", [] { return 2; });
    wait([&] { return ask(car1, "PULL car3:speed") == "{\"value\":2}"; });
}

BOOST_AUTO_TEST_CASE(rosters_spread) {
    cles::service car1{contexts[0], gossiping("car1")};
    cles::service car2{contexts[1], gossiping("car2", {&car1})};
    cles::service car3{contexts[2], gossiping("car3", {&car1})};
    wait([&] { return contains(known_to(car2), "car1") && contains(known_to(car2), "car3"); });
    fleet.with_newest = false;
    fleet.add("car4");
    const auto version = fleet.authority.newest().version();
    BOOST_TEST(ask(car2, "PUSH self:cles/roster " + fleet.authority.newest().line()) == "{}");
    wait([&] { return version_of(car1) == version && version_of(car3) == version; });
}

BOOST_AUTO_TEST_CASE(an_epoch_is_confirmed_through_a_node_that_forwards) {
    auto forwarding = gossiping("car1");
    forwarding.routing = cles::routing();
    cles::service car1{contexts[0], std::move(forwarding)};
    cles::service car2{contexts[1], gossiping("car2", {&car1})};
    cles::service car3{contexts[2], gossiping("car3", {&car1})};
    wait([&] { return contains(known_to(car1), "car2") && contains(known_to(car3), "car2"); });
    car2.update("pose", 1);
    cles::test::feed_log feed;
    feed.bind(car3, "car2:pose", cles::bind_options{}.at(car1.endpoints().front()));
    int value = 1;
    wait([&] {
        car2.update("pose", ++value);
        return feed.items.size() > 10;
    });
    BOOST_TEST(feed.bound);
}

BOOST_AUTO_TEST_SUITE_END()
