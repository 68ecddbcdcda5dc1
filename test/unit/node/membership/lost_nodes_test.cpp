// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_contacts.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <set>
#include <string>

namespace lost_nodes {
namespace {

using namespace std::chrono_literals;

struct fixture {
    void receive(const std::string& node, std::uint32_t epoch) {
        const cles::core::announcement said{.node = node, .endpoints = {"tcp://10.0.0.1:1"}};
        others.apply_announcement(said, epoch, 1, {0x0A000001, 1}, now);
    }
    std::string any() {
        const auto found = lost.any(others, now);
        return found ? found->name + " " + found->url : "nobody";
    }

    cles::time_point now{1h};
    cles::core::deadline_queue deadlines;
    cles::core::membership others{"me", 0xAAAA, deadlines, 10};
    cles::core::lost_nodes lost{2, 7};
};

} // namespace
} // namespace lost_nodes

BOOST_FIXTURE_TEST_SUITE(lost_nodes, fixture)

BOOST_AUTO_TEST_CASE(no_node_is_lost_at_first) { BOOST_TEST(any() == "nobody"); }

BOOST_AUTO_TEST_CASE(removed_node_is_tried_for_an_hour) {
    lost.add("car1", "tcp://10.0.0.1:1", now);
    BOOST_TEST(any() == "car1 tcp://10.0.0.1:1");
    now += 59min;
    BOOST_TEST(any() == "car1 tcp://10.0.0.1:1");
    now += 1min;
    BOOST_TEST(any() == "nobody");
}

BOOST_AUTO_TEST_CASE(node_that_returned_is_not_lost) {
    lost.add("car1", "tcp://10.0.0.1:1", now);
    receive("car1", 1);
    BOOST_TEST(any() == "nobody");
}

BOOST_AUTO_TEST_CASE(suspect_node_is_tried_too) {
    receive("car1", 1);
    now += 4s;
    deadlines.expire(now);
    BOOST_TEST(any() == "car1 tcp://10.0.0.1:1");
}

BOOST_AUTO_TEST_CASE(node_without_a_url_is_not_tried) {
    lost.add("car1", "", now);
    BOOST_TEST(any() == "nobody");
}

BOOST_AUTO_TEST_CASE(lost_nodes_are_bounded_and_chosen_at_random) {
    for (int i = 1; i <= 4; ++i) {
        lost.add("car" + std::to_string(i), "tcp://10.0.0.1:1", now);
    }
    std::set<std::string> seen;
    for (int i = 0; i < 50; ++i) {
        seen.insert(any());
    }
    BOOST_TEST(seen.size() == 2U);
    BOOST_TEST(seen.contains("car4 tcp://10.0.0.1:1"));
}

BOOST_AUTO_TEST_SUITE_END()
