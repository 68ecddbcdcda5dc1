// SPDX-License-Identifier: BSL-1.0
// A node in a multicast group on two interfaces: what it receives on both, and what it sends on each.
#include <cles/log.hpp>

#include "node/publish/multicast_group.hpp"
#include "support/group_recorder.hpp"
#include "support/hear.hpp"
#include "support/session_fixture.hpp"

#include <boost/system/error_code.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <cerrno>
#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace multicast_group {
namespace {

using namespace std::chrono_literals;
using cles::core::group_source;
using cles::test::hear;

constexpr group_source loopback{.address = 0x7F000001, .port = 4000};
constexpr group_source card{.address = 0x0A000001, .port = 4001};
constexpr std::array<group_source, 2> car2{
    {{.address = 0x7F000001, .port = 5000}, {.address = 0x0A000001, .port = 5001}}};
constexpr group_source forger{.address = 0x0A000009, .port = 4666};

struct fixture {
    static std::vector<std::string> of(std::initializer_list<std::string> lines) { return lines; }

    cles::test::test_node node;
    cles::test::group_recorder out_lo{loopback};
    cles::test::group_recorder out_card{card};
    cles::core::multicast_group group{node.host, 1};
    cles::core::group_session on_lo{node.host, group, out_lo.share(), 1};
    cles::core::group_session on_card{node.host, group, out_card.share(), 2};
};

} // namespace
} // namespace multicast_group

BOOST_FIXTURE_TEST_SUITE(multicast_group, fixture)

BOOST_AUTO_TEST_CASE(datagrams_of_this_node_are_ignored_on_every_interface) {
    hear(on_card, loopback, "BIND all:speed");
    hear(on_lo, card, "nonsense");
    BOOST_TEST(node.counts().group_received == 0U);
    BOOST_TEST(node.counts().group_leases == 0U);
    BOOST_TEST(group.is_of_this_host({.address = card.address, .port = 1}));
    BOOST_TEST(!group.is_of_this_host(forger));
}

BOOST_AUTO_TEST_CASE(an_update_is_sent_on_the_interfaces_with_subscribers) {
    node.publish_now("speed", "1");
    hear(on_lo, car2[0], "BIND all:speed lease=10000");
    node.publish_now("speed", "2");
    BOOST_TEST(out_lo.take().size() == 1U);
    BOOST_TEST(out_card.take().empty());
    hear(on_card, car2[1], "BIND all:speed lease=20000");
    node.publish_now("speed", "3");
    BOOST_TEST(out_lo.take().size() == 1U);
    BOOST_TEST(out_card.take().size() == 1U);
    BOOST_TEST(node.counts().group_leases == 2U);
    node.pass(10s);
    node.publish_now("speed", "4");
    BOOST_TEST(out_lo.take().empty());
    BOOST_TEST(out_card.take().size() == 1U);
    on_lo.stop();
    BOOST_TEST(node.counts().group_leases == 1U);
}

BOOST_AUTO_TEST_CASE(an_unpublished_noun_can_be_bound_on_each_interface) {
    hear(on_lo, car2[0], "BIND all:speed");
    hear(on_card, forger, "BIND all:speed");
    node.publish_now("speed", "1");
    BOOST_TEST(out_lo.take().size() == 1U);
    BOOST_TEST(out_card.take().size() == 1U);
}

BOOST_AUTO_TEST_CASE(an_interface_that_is_not_writable_does_not_delay_the_other) {
    hear(on_lo, car2[0], "BIND all:speed");
    hear(on_card, car2[1], "BIND all:speed");
    out_card.writable = false;
    node.publish_now("speed", "1");
    BOOST_TEST(out_lo.take().size() == 1U);
    BOOST_TEST(out_card.take().empty());
    out_card.writable = true;
    on_card.bindings().drain(node.clock.now());
    BOOST_TEST(out_card.take().size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_the_system_does_not_send_is_counted_and_logged_once) {
    std::vector<std::string> logged;
    cles::test::test_node talking{
        {}, {}, [&](cles::log_level, const cles::log_entry& entry) { logged.emplace_back(entry.text); }};
    cles::core::multicast_group shared{talking.host, 1};
    cles::core::group_session session{talking.host, shared, out_card.share(), 1};
    shared.send("BIND all:cles\n");
    out_card.failure = {ENETUNREACH, boost::system::system_category()};
    for (int i = 0; i < 3; ++i) {
        shared.send("BIND all:cles\n");
    }
    BOOST_TEST(talking.counts().group_sent == 1U);
    BOOST_TEST(talking.counts().group_failed == 3U);
    BOOST_TEST(logged == of({"cannot send to the multicast group from 10.0.0.1: " + out_card.failure.message()}),
               boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_session_that_ends_is_not_used_any_more) {
    {
        constexpr group_source other{.address = 0x0A000002, .port = 4002};
        cles::test::group_recorder out_other{other};
        cles::core::group_session on_other{node.host, group, out_other.share(), 3};
        BOOST_TEST(group.ports().size() == 3U);
    }
    BOOST_TEST(group.ports().size() == 2U);
    BOOST_TEST(group.send("BIND all:cles\n"));
}

BOOST_AUTO_TEST_CASE(feeds_are_bound_on_an_interface_that_is_new) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    out_lo.take();
    out_card.take();
    group.feeds().bind_on(out_card);
    BOOST_TEST(out_lo.take().empty());
    BOOST_TEST(out_card.take() == of({"BIND all:speed lease=10000"}), boost::test_tools::per_element());
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_CASE(the_limit_on_leases_is_common) {
    cles::limits few;
    few.group_leases = 2;
    cles::test::test_node small{few};
    cles::core::multicast_group shared{small.host, 1};
    cles::core::group_session a{small.host, shared, out_lo.share(), 1};
    cles::core::group_session b{small.host, shared, out_card.share(), 2};
    for (const std::string noun : {"x", "y", "z"}) {
        hear(a, car2[0], "BIND all:" + noun);
        hear(b, car2[1], "BIND all:" + noun);
    }
    BOOST_TEST(small.counts().group_leases == 2U);
    BOOST_TEST(small.counts().group_dropped == 4U);
}

BOOST_AUTO_TEST_CASE(a_feed_is_bound_on_both_and_receives_each_update_once) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    BOOST_TEST(out_lo.take() == of({"BIND all:speed lease=10000"}), boost::test_tools::per_element());
    BOOST_TEST(out_card.take() == of({"BIND all:speed lease=10000"}), boost::test_tools::per_element());
    node.host->peers.apply_announcement({.node = "car2", .sources = {car2.begin(), car2.end()}}, 0x5f3a09c1, 1, car2[0],
                                        node.clock.now());
    for (std::uint64_t seq = 1; seq <= 6; ++seq) {
        const auto update = "UPDATE car2:speed seq=" + std::to_string(seq) + " epoch=5f3a09c1 {}";
        if (seq != 3) { // lost on this interface
            hear(seq % 2 == 0 ? on_lo : on_card, car2[seq % 2], update);
        }
        if (seq != 5) { // and on this one
            hear(seq % 2 == 0 ? on_card : on_lo, car2[1 - seq % 2], update);
        }
    }
    BOOST_TEST(node.counts().updates_received == 6U);
    BOOST_TEST(node.counts().group_repeated == 4U);
    BOOST_TEST(node.counts().updates_dropped == 0U);
    BOOST_TEST(feed.publishers() == 1U);
    hear(on_card, forger, "UPDATE car2:speed seq=99 epoch=5f3a09c1 {}");
    hear(on_card, forger, "UPDATE car2:speed seq=1 epoch=00000bad {}");
    BOOST_TEST(node.counts().updates_received == 6U);
    BOOST_TEST(node.counts().updates_dropped == 2U);
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_CASE(a_publisher_without_announcements_is_accepted_on_one_interface) {
    cles::core::group_feed feed{{}, node.host->completions, "all", "speed"};
    group.feeds().add(feed, node.clock.now());
    for (std::uint64_t seq = 1; seq <= 3; ++seq) {
        const auto update = "UPDATE car2:speed seq=" + std::to_string(seq) + " epoch=5f3a09c1 {}";
        hear(on_lo, car2[0], update);
        hear(on_card, car2[1], update);
    }
    BOOST_TEST(node.counts().updates_received == 3U);
    BOOST_TEST(node.counts().updates_dropped == 3U);
    node.pass(3500ms);
    hear(on_card, car2[1], "UPDATE car2:speed seq=4 epoch=5f3a09c1 {}");
    BOOST_TEST(node.counts().updates_received == 4U);
    group.feeds().remove(feed);
}

BOOST_AUTO_TEST_SUITE_END()
