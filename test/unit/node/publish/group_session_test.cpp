// SPDX-License-Identifier: BSL-1.0
#include "node/publish/multicast_group.hpp"
#include "support/group_recorder.hpp"
#include "support/hear.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace group_session {
namespace {

using cles::core::group_source;

constexpr group_source self{.address = 0x7f000001, .port = 4000};
constexpr group_source other{.address = 0x7f000001, .port = 4001};

class recording_presence final : public cles::core::announcement_listener {
  public:
    void on_solicitation(bool by_name, cles::time_point) override {
        told.emplace_back(by_name ? "solicited by name" : "solicited");
    }
    void on_announcement(cles::core::heard_announcement heard, cles::time_point) override {
        told.push_back(std::to_string(heard.from.port) + " " + heard.said.node + " " + std::to_string(heard.seq) + " " +
                       cles::protocol::epoch_text(heard.epoch) + (heard.said.original ? " signed" : ""));
    }
    std::vector<std::string> told;
};

struct fixture {
    fixture() { group.set_listener(&membership); }
    void hear(std::string_view datagram, const group_source& from = other) {
        cles::test::hear(session, from, datagram);
    }
    /// Whether the datagram was dropped.
    bool drops(std::string_view datagram) {
        const auto before = node.counts().group_dropped;
        hear(datagram);
        return node.counts().group_dropped != before;
    }

    cles::test::test_node node;
    recording_presence membership;
    cles::test::group_recorder out{self};
    cles::core::multicast_group group{node.host, 1};
    cles::core::group_session session{node.host, group, out.share(), 1};
};

} // namespace
} // namespace group_session

BOOST_FIXTURE_TEST_SUITE(group_session, fixture)

BOOST_AUTO_TEST_CASE(a_source_is_written_as_an_address) {
    BOOST_TEST(host_text(group_source{.address = 0xC0000207, .port = 1}) == "192.0.2.7");
    BOOST_TEST(self.is_loopback());
    BOOST_TEST(!group_source{.address = 0xC0000207}.is_loopback());
}

BOOST_AUTO_TEST_CASE(an_announcement_is_passed_to_the_listener) {
    hear(R"(UPDATE car2:cles seq=3 epoch=5f3a09c1 {"node":"car2"})"
         "\n");
    BOOST_REQUIRE(membership.told.size() == 1U);
    BOOST_TEST(membership.told[0] == "4001 car2 3 5f3a09c1");
    BOOST_TEST(node.counts().group_received == 1U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(a_solicitation_is_passed_to_the_listener) {
    hear("BIND all:cles");
    BOOST_REQUIRE(membership.told.size() == 1U);
    BOOST_TEST(membership.told[0] == "solicited");
}

BOOST_AUTO_TEST_CASE(a_solicitation_by_name_is_for_that_node_only) {
    hear("BIND " + node.host->name + ":cles");
    hear("BIND another:cles");
    BOOST_REQUIRE(membership.told.size() == 1U);
    BOOST_TEST(membership.told[0] == "solicited by name");
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(the_nodes_own_datagrams_are_ignored) {
    hear("BIND all:cles", self);
    hear("nonsense", self);
    BOOST_TEST(membership.told.empty());
    BOOST_TEST(node.counts().group_received == 0U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

const std::vector<std::string> unwanted{
    "",
    "\n",
    "nonsense",
    "PULL self:cles",
    "PULL all:cles",
    "PUSH car1:speed {}",
    "DELEGATE all:plan {}",
    "PUSH self:cles/cancel/1",
    "UPDATE car1:localization {}",
    "UPDATE all:localization seq=1 epoch=5f3a09c1 {}",
    "UPDATE self:localization seq=1 epoch=5f3a09c1 {}",
    "UPDATE car2:localization seq=1 {}",
    "BIND self:localization",
    "BIND any:localization",
    "BIND all:cles/peers",
    "BIND car1:cles/peers",
    "BIND all:localization\nBIND all:speed",
    "BIND all:cles\n\n",
    "BIND all:cles {}",
    "BIND all:cles lease=x",
    "UPDATE car2:cles/x seq=1 epoch=5f3a09c1 {}",
    "UPDATE car2:cles seq=1 epoch=5f3a09c1 {\"node\":}",
    "UPDATE car2:cles seq=1 epoch=5f3a09c1",
    "BIND all:localization {}",
    "{}",
    "id=1 {}",
};

BOOST_DATA_TEST_CASE(all_that_is_neither_BIND_of_a_name_nor_an_update_is_dropped, unwanted, datagram) {
    BOOST_TEST(drops(datagram));
    BOOST_TEST(membership.told.empty());
}

BOOST_AUTO_TEST_CASE(a_datagram_over_1200_bytes_is_dropped) {
    const std::string head = "UPDATE car2:cles seq=1 epoch=5f3a09c1 {\"x\":\"";
    const auto of = [&](std::size_t size) { return head + std::string(size - head.size() - 2, 'x') + "\"}"; };
    BOOST_TEST(drops(of(1201)));
    BOOST_TEST(!drops(of(1200)));
}

BOOST_AUTO_TEST_CASE(nothing_is_ever_answered_in_the_group) {
    node.publish_now("speed", "1");
    for (const auto* line : {"PULL car1:speed", "PULL self:cles", "BIND car1:nothing", "nonsense", "id=1 {}"}) {
        hear(line);
    }
    BOOST_TEST(out.take().empty());
}

BOOST_AUTO_TEST_CASE(a_bind_of_another_node_is_neither_served_nor_counted) {
    node.publish_now("speed", "1");
    BOOST_TEST(!drops("BIND car2:speed"));
    BOOST_TEST(node.counts().group_leases == 0U);
}

BOOST_AUTO_TEST_CASE(a_bind_of_all_or_of_this_node_is_served) {
    node.publish_now("speed", "{}");
    BOOST_TEST(!drops("BIND car1:speed"));
    BOOST_TEST(out.take().size() == 1U);
    hear("BIND all:speed", {.address = 0x7f000001, .port = 4002});
    BOOST_TEST(node.counts().group_leases == 2U);
}

BOOST_AUTO_TEST_CASE(the_access_rules_apply_as_on_links) {
    std::vector<std::string> asked;
    cles::test::test_node strict{{}, [&](const cles::access& a) {
                                     asked.push_back(a.peer.transport + " " + a.peer.address + " " +
                                                     std::string{to_string(a.verb)} + " " + std::string{a.path});
                                     return a.task == "open";
                                 }};
    cles::core::multicast_group group_there{strict.host, 1};
    cles::core::group_session guarded{strict.host, group_there, out.share(), 1};
    recording_presence told;
    group_there.set_listener(&told);
    for (const auto* line : {"BIND all:open", "BIND all:secret/x", "BIND all:cles"}) {
        cles::test::hear(guarded, other, line);
    }
    BOOST_TEST(strict.counts().group_leases == 1U);
    BOOST_TEST(strict.counts().group_dropped == 2U);
    BOOST_TEST(told.told.empty());
    BOOST_REQUIRE(asked.size() == 3U);
    BOOST_TEST(asked[1] == "multicast udp://127.0.0.1:4001 BIND secret/x");
}

BOOST_AUTO_TEST_CASE(the_handler_for_bind_may_refuse) {
    node.on(cles::verb::bind, "speed", [](const cles::request& r, cles::json_writer&) {
        if (!r.parameters().empty()) {
            throw cles::error(cles::errc::bad_request, "speed takes no parameters");
        }
    });
    BOOST_TEST(drops("BIND all:speed/x"));
    BOOST_TEST(!drops("BIND all:speed/x lease=0"));
    BOOST_TEST(!drops("BIND all:speed"));
    BOOST_TEST(node.counts().group_leases == 1U);
}

BOOST_AUTO_TEST_CASE(an_update_that_nobody_wants_is_counted) {
    BOOST_TEST(!drops("UPDATE car2:speed seq=1 epoch=5f3a09c1 {}"));
    BOOST_TEST(node.counts().updates_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(an_update_that_begins_like_a_failure_is_dropped) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    hear(R"(UPDATE car2:speed seq=1 epoch=5f3a09c1 {"error":"failed"})");
    BOOST_TEST(node.counts().updates_dropped == 1U);
    hear("UPDATE car2:speed seq=2 epoch=5f3a09c1 {}");
    BOOST_TEST(node.counts().updates_received == 1U);
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_CASE(a_forged_update_does_not_displace_a_publisher) {
    using namespace std::chrono_literals;
    constexpr group_source forger{.address = 0x7f000001, .port = 4666};
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    node.host->peers.apply_announcement({.node = "car2", .endpoints = {"tcp://127.0.0.1:1"}}, 0x5f3a09c1, 1, other,
                                        node.clock.now());
    const auto received = [&](std::string_view update, const group_source& from) {
        const auto before = node.counts().updates_received;
        hear(update, from);
        return node.counts().updates_received != before;
    };
    for (const std::string name : {"car2", "car3"}) { // car3 does not announce itself
        const auto head = "UPDATE " + name + ":speed ";
        BOOST_TEST(received(head + "seq=1 epoch=5f3a09c1 {}", other));
        BOOST_TEST(!received(head + "seq=1 epoch=00000bad {}", forger));
        BOOST_TEST(!received(head + "seq=18446744073709551615 epoch=5f3a09c1 {}", forger));
        BOOST_TEST(received(head + "seq=2 epoch=5f3a09c1 {}", other));
    }
    // A source that takes over from a silent publisher is itself replaced once it falls silent.
    node.pass(3500ms);
    BOOST_TEST(received("UPDATE car3:speed seq=9 epoch=00000bad {}", forger));
    BOOST_TEST(!received("UPDATE car3:speed seq=3 epoch=5f3a09c1 {}", other));
    node.pass(3500ms);
    BOOST_TEST(received("UPDATE car3:speed seq=4 epoch=5f3a09c1 {}", other));
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_CASE(another_pool_is_ignored) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    out.take();
    group.ignore_until(other, node.clock.now() + std::chrono::seconds{15});
    hear("UPDATE car2:speed seq=1 epoch=5f3a09c1 {}");
    BOOST_TEST(node.counts().updates_received == 0U);
    BOOST_TEST(drops("BIND all:speed"));
    BOOST_TEST(node.counts().group_leases == 0U);
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_SUITE_END()
