// SPDX-License-Identifier: BSL-1.0
#include "node/membership/route_table.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace route_table {
namespace {

using cles::core::route_advert;

constexpr std::uint32_t epoch = 0xA;

struct fixture {
    cles::core::route_table table{100};
    std::set<std::string, std::less<>> broken; // neighbours that cannot be used

    [[nodiscard]] auto usable() const {
        return [this](std::string_view by) { return !broken.contains(by); };
    }
    static bool all(std::string_view) { return true; }
    static bool offers(const cles::core::route_table& in, std::string_view name, std::string_view by) {
        const auto found = in.neighbours_of(name);
        return std::ranges::find(found, by) != found.end();
    }
    void offer(std::string_view by, std::uint64_t seq, std::optional<unsigned> hops, std::uint32_t run = epoch) {
        table.apply("far", run, by, {seq, hops}, usable());
    }
    std::string hop(std::string_view avoid = {}) {
        const auto* const found =
            table.find_route("far", usable(), [avoid](std::string_view by) { return by == avoid; });
        return found == nullptr ? std::string{} : found->by;
    }
    route_advert advert(std::string_view to = "asker", bool direct = false) {
        return table.advertise("far", epoch, direct, usable(), to);
    }
};

BOOST_FIXTURE_TEST_SUITE(route_table, fixture)

BOOST_AUTO_TEST_CASE(the_shortest_route_is_used_and_advertised_one_link_longer) {
    offer("a", 7, 3);
    offer("b", 7, 1);
    BOOST_TEST(hop() == "b");
    BOOST_TEST((advert() == route_advert{7, 2}));
    BOOST_TEST(table.find_route("far", usable())->hops == 1U);
}

BOOST_AUTO_TEST_CASE(of_equal_routes_the_newest_and_then_the_first_name_is_used) {
    offer("b", 7, 1);
    offer("a", 7, 1);
    BOOST_TEST(hop() == "a");
    offer("b", 8, 1);
    BOOST_TEST(hop() == "b");
}

BOOST_AUTO_TEST_CASE(without_an_offer_there_is_no_route) {
    BOOST_TEST(hop().empty());
    BOOST_TEST((advert() == route_advert{}));
    BOOST_TEST((table.find_route("far", usable()) == nullptr));
}

// As long as what this node advertised last may have come back to it.
BOOST_AUTO_TEST_CASE(a_longer_route_of_the_same_number_is_not_advertised) {
    offer("a", 7, 1);
    BOOST_TEST((advert() == route_advert{7, 2}));
    offer("b", 7, 2); // it may lead through this node
    offer("a", 7, std::nullopt);
    BOOST_TEST(hop() == "b"); // the best that requests have
    BOOST_TEST((advert() == route_advert{7, std::nullopt}));
    offer("b", 8, 2);
    BOOST_TEST((advert() == route_advert{8, 3}));
}

BOOST_AUTO_TEST_CASE(the_number_of_a_withdrawn_route_counts) {
    offer("a", 7, 1);
    offer("b", 11, std::nullopt);
    BOOST_TEST(hop().empty()); // it is four intervals late
    BOOST_TEST((advert() == route_advert{11, std::nullopt}));
}

BOOST_AUTO_TEST_CASE(a_feasible_route_is_preferred_to_a_shorter_one_that_may_form_a_loop) {
    offer("a", 7, 1);
    advert();
    offer("b", 6, 0);
    offer("c", 8, 5);
    offer("a", 7, std::nullopt);
    BOOST_TEST(hop() == "c");
}

BOOST_AUTO_TEST_CASE(a_route_is_not_advertised_to_the_neighbour_that_it_leads_through) {
    offer("a", 7, 1);
    BOOST_TEST((advert("a") == route_advert{7, std::nullopt}));
    BOOST_TEST((advert("b") == route_advert{7, 2}));
}

BOOST_AUTO_TEST_CASE(of_a_node_with_a_link_the_newest_known_number_is_advertised) {
    BOOST_TEST((advert("a", true) == route_advert{0, 1}));
    offer("a", 9, 4);
    BOOST_TEST((advert("a", true) == route_advert{9, 1}));
}

BOOST_AUTO_TEST_CASE(after_a_link_is_lost_only_shorter_or_newer_routes_are_advertised) {
    offer("a", 9, 1);
    BOOST_TEST((advert("x", true) == route_advert{9, 1}));
    BOOST_TEST((advert("x") == route_advert{9, std::nullopt}));
    offer("a", 10, 1);
    BOOST_TEST((advert("x") == route_advert{10, 2}));
}

BOOST_AUTO_TEST_CASE(neighbours_that_are_broken_or_to_be_avoided_are_not_used) {
    offer("a", 7, 1);
    offer("b", 7, 2);
    BOOST_TEST(hop("a") == "b");
    broken.insert("a");
    BOOST_TEST(hop() == "b");
    BOOST_TEST(hop("b").empty());
}

BOOST_AUTO_TEST_CASE(an_offer_that_is_four_intervals_late_is_not_used) {
    offer("a", 7, 1);
    offer("b", 10, 5);
    BOOST_TEST(hop() == "a");
    offer("b", 11, 5);
    BOOST_TEST(hop() == "b");
}

BOOST_AUTO_TEST_CASE(another_incarnation_is_another_destination) {
    offer("a", 70, 1);
    advert();
    offer("b", 1, 2, 0xB);
    BOOST_TEST(hop() == "b");
    BOOST_TEST((advert() == route_advert{})); // of the previous one
    BOOST_TEST((table.advertise("far", 0xB, false, usable(), "x") == route_advert{1, 3}));
}

BOOST_AUTO_TEST_CASE(a_route_has_at_most_sixteen_links) {
    offer("a", 7, 15);
    BOOST_TEST(hop() == "a");
    offer("a", 7, 16);
    BOOST_TEST(hop().empty());
}

BOOST_AUTO_TEST_CASE(the_table_is_bounded) {
    cles::core::route_table small{2};
    std::uint32_t run = 0;
    for (const auto* name : {"x", "y", "z"}) {
        small.apply(name, ++run, "a", {1, 1}, all);
    }
    BOOST_TEST(small.size() == 2U);
    for (int i = 0; i < 40; ++i) {
        small.apply("x", 1, "n" + std::to_string(i), {1, 1}, all);
    }
    BOOST_TEST(!offers(small, "x", "n39"));
    BOOST_TEST(offers(small, "x", "n14"));
}

BOOST_AUTO_TEST_CASE(of_two_nodes_with_one_epoch_the_last_counts) {
    offer("a", 7, 1);
    table.apply("near", epoch, "b", {1, 0}, all);
    BOOST_TEST(table.size() == 1U);
    BOOST_TEST(hop().empty());
    BOOST_TEST(offers(table, "near", "b"));
    BOOST_TEST((advert() == route_advert{}));
}

BOOST_AUTO_TEST_CASE(a_newer_offer_replaces_the_oldest_where_there_are_sixteen) {
    for (unsigned i = 0; i < 16; ++i) {
        offer("n" + std::to_string(i), 5 + i % 2, 1);
    }
    offer("late", 5, 1);
    BOOST_TEST(!offers(table, "far", "late"));
    offer("late", 6, 0);
    BOOST_TEST(hop() == "late");
}

BOOST_AUTO_TEST_CASE(the_destinations_of_a_neighbour_are_known) {
    offer("a", 7, 1);
    table.apply("near", 1, "a", {1, 0}, all);
    table.apply("near", 1, "b", {1, 2}, all);
    BOOST_TEST(table.destinations_by("a").size() == 2U);
    BOOST_TEST(table.destinations_by("b").size() == 1U);
    table.forget("near");
    BOOST_TEST(table.destinations_by("b").empty());
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace
} // namespace route_table
