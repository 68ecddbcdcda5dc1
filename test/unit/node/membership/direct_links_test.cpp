// SPDX-License-Identifier: BSL-1.0
#include "node/membership/direct_links.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace direct_links {
namespace {

using namespace std::chrono_literals;
using cles::time_point;
using state = cles::core::direct_links::state;

struct fixture {
    void hear(const std::string& node, std::vector<std::string> allowed = {}, std::uint64_t seq = 1) {
        cles::core::announcement said{.node = node, .endpoints = {"tcp://10.0.0.7:1"}};
        said.tasks = "1";
        said.links = std::move(allowed);
        others.apply_gossip({said, 0xB, seq, 0ms}, {"10.0.0.7", false}, now, now);
    }

    [[nodiscard]] state state_of(std::string_view node) const { return links.state_of(node, others); }

    cles::core::deadline_queue deadlines;
    cles::core::membership others{"me", 0xA, deadlines, 10};
    cles::core::direct_links links{"me"};
    time_point now = time_point{} + 1h;
};

BOOST_FIXTURE_TEST_SUITE(direct_links, fixture)

BOOST_AUTO_TEST_CASE(without_a_list_all_nodes_with_an_address_are_reached) {
    BOOST_TEST((state_of("car1") == state::none));
    hear("car1");
    BOOST_TEST((state_of("car1") == state::untried));
}

BOOST_AUTO_TEST_CASE(the_lists_of_both_nodes_count) {
    hear("car1");
    hear("car2");
    links.allow_only({"car1"});
    BOOST_TEST((state_of("car1") == state::untried));
    BOOST_TEST((state_of("car2") == state::none));
    links.allow_only({});
    hear("car1", {"car2"}, 2);
    BOOST_TEST((state_of("car1") == state::none));
    hear("car1", {"car2", "me"}, 3);
    BOOST_TEST((state_of("car1") == state::untried));
}

BOOST_AUTO_TEST_CASE(a_node_that_does_not_reply_is_not_used_for_others_and_still_tried_itself) {
    hear("car1");
    BOOST_TEST(links.on_failure("car1", now));
    BOOST_TEST(!links.on_failure("car1", now));
    BOOST_TEST((state_of("car1") == state::silent));
}

BOOST_AUTO_TEST_CASE(the_link_is_lost_if_the_node_announces_itself_afterwards) {
    hear("car1");
    links.on_failure("car1", now);
    now += 1s;
    hear("car1", {}, 2);
    BOOST_TEST((state_of("car1") == state::lost));
    BOOST_TEST((links.failed_at("car1") == now - 1s));
}

BOOST_AUTO_TEST_CASE(the_link_is_lost_if_another_node_has_one) {
    hear("car1");
    links.on_alive("car1");
    BOOST_TEST((state_of("car1") == state::untried));
    links.on_failure("car1", now);
    links.on_alive("car1");
    BOOST_TEST((state_of("car1") == state::lost));
}

BOOST_AUTO_TEST_CASE(a_lost_link_is_tried_again_after_pauses_that_double) {
    hear("car1");
    links.on_failure("car1", now);
    links.on_alive("car1");
    BOOST_TEST(!links.is_due("car1", now + 1999ms));
    BOOST_TEST(links.is_due("car1", now + 2s));
    now += 2s;
    links.on_failure("car1", now);
    links.on_failure("car1", now); // of the same attempt
    BOOST_TEST(!links.is_due("car1", now + 3999ms));
    BOOST_TEST(links.is_due("car1", now + 4s));
}

BOOST_AUTO_TEST_CASE(a_reply_ends_it) {
    hear("car1");
    links.on_failure("car1", now);
    BOOST_TEST(links.on_success("car1"));
    BOOST_TEST(!links.on_success("car1"));
    BOOST_TEST((state_of("car1") == state::open));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace
} // namespace direct_links
