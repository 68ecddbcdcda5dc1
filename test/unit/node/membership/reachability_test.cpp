// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachability.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace reachability {
namespace {

using namespace std::chrono_literals;
using cles::time_point;
using cles::core::route_advert;

struct fixture : cles::core::reachability::listener {
    fixture() {
        hear("car1", 0xB);
        hear("car2", 0xC);
        hear("far", 0xF, {"car1", "car2"});
    }

    [[nodiscard]] bool forwards_for(std::string_view) const override { return routes; }
    [[nodiscard]] bool may_forward(std::string_view node, std::string_view requester) const override {
        return !forbidden.contains(node) && (requester != "stranger" || node != "car2");
    }
    [[nodiscard]] bool is_member(std::string_view node) const override { return !removed.contains(node); }
    void on_route_lost(std::string_view node, std::string_view address) override {
        lost.emplace_back(std::string{node} + " by " + std::string{address});
    }
    void on_route_changed(std::string_view node) override { changed.insert(std::string{node}); }

    void hear(const std::string& node, std::uint32_t epoch, std::vector<std::string> links = {},
              std::uint64_t seq = 1) {
        cles::core::announcement said{.node = node, .endpoints = {"tcp://10.0.0.7:" + std::to_string(epoch)}};
        said.tasks = "1";
        said.links = std::move(links);
        others.apply_gossip({said, epoch, seq, 0ms}, {"10.0.0.7", false}, now, now);
    }
    /// The neighbour replies, and advertises a route to `far`.
    void reply(const std::string& by, route_advert advert) {
        cles::core::peer_table table;
        table.node = by;
        table.routes = {{.epoch = 0xF, .advert = advert}};
        reach.on_reply(table);
    }
    /// The neighbour asks for a number.
    void ask(const std::string& by, std::uint32_t epoch, route_advert number) {
        cles::core::peer_table table;
        table.node = by;
        table.wanted = {{.epoch = epoch, .advert = number}};
        reach.on_pushed(table);
    }
    /// What is to be pushed, after the pause between pushes.
    cles::core::reachability::news news() {
        now = std::max(now, reach.next_push());
        return reach.take_unsent(now);
    }
    /// The number that is asked for with it, and how far that may spread; empty: none.
    std::string wanted(const std::string& node) {
        const auto sent = news();
        const auto at = sent.find(node);
        return at == sent.end() || !at->second
                   ? ""
                   : "[" + std::to_string(at->second->seq) + "," + std::to_string(*at->second->hops) + "]";
    }
    [[nodiscard]] auto advert(std::string_view of, std::string_view to) {
        using cles::core::delta_entry;
        const auto item = of == "me"
                              ? delta_entry::of(delta_entry::kind::heartbeat, of, *others.own(), cles::peer_state::live)
                              : others.entry_of(of).value();
        return reach.advert_of(item, to);
    }

    bool routes = true;
    std::set<std::string, std::less<>> forbidden; // neighbours that may not forward
    std::set<std::string, std::less<>> removed;   // from the roster
    std::vector<std::string> lost;
    std::set<std::string> changed;
    time_point now = time_point{} + 1h;
    cles::core::deadline_queue deadlines;
    cles::core::membership others{"me", 0xA, deadlines, 10};
    cles::core::reachability reach{"me", *this, others, 10};
};

BOOST_FIXTURE_TEST_SUITE(reachability, fixture)

BOOST_AUTO_TEST_CASE(a_node_whose_links_exclude_this_one_is_reached_through_a_neighbour) {
    BOOST_TEST(reach.next_hop_to("far", {}).empty());
    BOOST_TEST(!reach.hops_to("far"));
    reply("car2", {5, 1});
    reply("car1", {5, 2});
    BOOST_TEST(reach.next_hop_to("far", {}) == "car2");
    BOOST_TEST(reach.next_hop_to("far", "car9,car2") == "car1");
    BOOST_TEST(reach.next_hop_to("far", "car1,car2").empty());
    BOOST_TEST(reach.hops_to("far").value() == 2U);
    BOOST_TEST(reach.is_beyond("far"));
    BOOST_TEST(!reach.is_beyond("car1"));
    BOOST_TEST(!reach.is_beyond("nobody"));
}

BOOST_AUTO_TEST_CASE(the_list_of_nodes_shows_the_routes) {
    reply("car2", {5, 1});
    auto all = others.list(now);
    reach.add_routes(all);
    for (const auto& each : all) {
        BOOST_TEST(each.hops == (each.node == "far" ? 2U : 1U));
        BOOST_TEST(each.via == (each.node == "far" ? "car2" : ""));
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_does_not_forward_advertises_only_itself) {
    cles::core::announcement said{.node = "me"};
    others.announce_self(said, 1, now);
    reply("car2", {5, 1});
    BOOST_TEST(advert("far", "car1").value().hops.value() == 2U);
    BOOST_TEST(advert("car2", "car1").value().hops.value() == 1U);
    BOOST_TEST(!advert("car1", "car1")); // it knows itself
    routes = false;
    BOOST_TEST(!advert("far", "car1"));
}

BOOST_AUTO_TEST_CASE(a_node_that_has_never_replied_is_not_advertised_as_a_neighbour) {
    BOOST_TEST(!advert("car2", "car1").value().hops);
    reach.on_opened("car2"); // nothing has failed
    BOOST_TEST(!advert("car2", "car1").value().hops);
    reach.on_reached("car2");
    BOOST_TEST(advert("car2", "car1").value().hops.value() == 1U);
    reach.lose("car2", now);
    BOOST_TEST(!advert("car2", "car1").value().hops);
    reach.on_opened("car2");
    BOOST_TEST(advert("car2", "car1").value().hops.value() == 1U);
}

BOOST_AUTO_TEST_CASE(a_number_that_others_state_for_this_node_is_not_ahead_of_its_own) {
    cles::core::announcement said{.node = "me"};
    others.announce_self(said, 1, now);
    cles::core::peer_table table;
    table.node = "car1";
    table.routes = {{.epoch = 0xA, .advert = {900, 1}}};
    reach.on_reply(table);
    BOOST_TEST(advert("me", "car1").value().seq == 900U);
    table.routes = {{.epoch = 0xA, .advert = {~std::uint64_t{0}, 1}}};
    reach.on_reply(table);
    BOOST_TEST(advert("me", "car1").value().seq == 900U);
    reply("car1", {~std::uint64_t{0}, std::nullopt});
    reply("car2", {5, 1});
    BOOST_TEST(reach.next_hop_to("far", {}) == "car2");
}

BOOST_AUTO_TEST_CASE(its_number_stays_below_the_greatest_one_that_counts) {
    constexpr auto most = std::uint64_t{1} << 62U;
    cles::core::announcement said{.node = "me"};
    others.announce_self(said, 1, now);
    cles::core::peer_table table;
    table.node = "car1";
    table.routes = {{.epoch = 0xA, .advert = {most, 1}}};
    reach.on_reply(table);
    for (int i = 0; i < 3; ++i) {
        now += 1s;
        reach.on_question({.distance = 16, .by = "car1"}, now);
        ask("car1", 0xA, {most + 2, 16});
    }
    BOOST_TEST(advert("me", "car1").value().seq == most);
}

BOOST_AUTO_TEST_CASE(only_a_node_itself_states_a_route_of_no_links) {
    reply("car2", {5, 0});
    BOOST_TEST(!reach.hops_to("far"));
    cles::core::peer_table table;
    table.node = "car1";
    table.routes = {{.epoch = 0xB, .advert = {5, 3}}};
    reach.on_reply(table);
    BOOST_TEST(advert("car1", "car2").value().seq == 0U);
    table.routes = {{.epoch = 0xB, .advert = {5, 0}}};
    reach.on_reply(table);
    BOOST_TEST(advert("car1", "car2").value().seq == 5U);
}

// -- in a secured fleet ----------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_neighbour_without_the_right_to_forward_states_only_its_own_route) {
    cles::core::announcement said{.node = "me"};
    others.announce_self(said, 1, now);
    forbidden.insert("car2");
    reply("car2", {5, 1});
    BOOST_TEST(!reach.hops_to("far"));
    cles::core::peer_table table;
    table.node = "car2";
    table.routes = {{.epoch = 0xC, .advert = {7, 0}}, {.epoch = 0xA, .advert = {900, 1}}};
    reach.on_reply(table);
    BOOST_TEST(advert("car2", "car1").value().seq == 7U);
    BOOST_TEST(advert("me", "car1").value().seq < 900U);
    reply("car1", {5, 2});
    BOOST_TEST(reach.next_hop_to("far", {}) == "car1");
}

BOOST_AUTO_TEST_CASE(a_route_ends_with_the_right_of_its_neighbour) {
    reply("car2", {5, 1});
    reply("car1", {5, 2});
    lost.clear();
    changed.clear();
    news();
    forbidden.insert("car2");
    BOOST_TEST(reach.next_hop_to("far", {}) == "car1");
    reach.on_rights_changed();
    BOOST_TEST(lost == (std::vector<std::string>{"far by tcp://10.0.0.7:12"}), boost::test_tools::per_element());
    BOOST_TEST(changed.contains("far"));
    BOOST_TEST(news().contains("far"));
    forbidden.clear();
    BOOST_TEST(reach.next_hop_to("far", {}) == "car2");
}

BOOST_AUTO_TEST_CASE(a_request_of_another_takes_a_route_whose_neighbour_may_forward_for_that_one) {
    reply("car2", {5, 1});
    reply("car1", {5, 2});
    BOOST_TEST(reach.next_hop_to("far", {}, "somebody") == "car2");
    BOOST_TEST(reach.next_hop_to("far", {}, "stranger") == "car1");
    BOOST_TEST(reach.next_hop_to("far", "car1", "stranger").empty());
    BOOST_TEST(reach.next_hop_to("car2", {}, "stranger") == "car2"); // it is the target
}

BOOST_AUTO_TEST_CASE(a_node_that_is_not_in_the_roster_has_no_route) {
    removed.insert("far");
    reply("car2", {5, 1});
    BOOST_TEST(!reach.hops_to("far"));
    ask("car1", 0xF, {6, 16});
    BOOST_TEST(wanted("far").empty());
    BOOST_TEST(!advert("far", "car1"));
}

// -- losses ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_route_that_is_withdrawn_twice_is_lost_once) {
    reply("car2", {5, 1});
    reply("car2", {6, std::nullopt});
    reply("car2", {7, std::nullopt});
    BOOST_TEST(lost.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_neighbour_that_does_not_reply_is_not_used_and_its_routes_are_reported) {
    reply("car2", {5, 1});
    reply("car1", {5, 2});
    reach.lose("car2", now);
    BOOST_TEST(reach.next_hop_to("far", {}) == "car1");
    BOOST_TEST(lost == (std::vector<std::string>{"far by tcp://10.0.0.7:12"}), boost::test_tools::per_element());
    BOOST_TEST(changed.contains("far"));
    BOOST_TEST(reach.take_unsent(now).contains("far"));
    BOOST_TEST(reach.take_unsent(now).empty());
    reply("car2", {6, 1});
    BOOST_TEST(reach.next_hop_to("far", {}) == "car2");
}

BOOST_AUTO_TEST_CASE(changes_are_pushed_once_a_turn) {
    reply("car2", {5, 1});
    BOOST_TEST(reach.take_unsent(now).size() == 1U);
    reply("car2", {5, std::nullopt});
    BOOST_TEST(reach.has_unsent());
    BOOST_TEST(reach.take_unsent(now).empty());
    now = reach.next_push();
    BOOST_TEST(reach.take_unsent(now).size() == 1U);
}

// It has stated a number that it would not have reached by itself.
BOOST_AUTO_TEST_CASE(a_node_that_answers_others_has_not_crashed) {
    const auto hear_of_car2 = [&](std::uint64_t number) {
        cles::core::peer_table table;
        table.node = "car1";
        table.routes = {{.epoch = 0xC, .advert = {number, 1}}};
        reach.on_reply(table);
    };
    hear_of_car2(3);
    reach.lose("car2", now);
    BOOST_TEST(wanted("car2") == "[5,16]");
    BOOST_TEST(reach.next_hop_to("car2", {}) == "car2"); // it may have crashed
    hear_of_car2(4);
    BOOST_TEST(reach.next_hop_to("car2", {}) == "car2");
    hear_of_car2(5);
    BOOST_TEST(reach.next_hop_to("car2", {}) == "car1");
    BOOST_TEST(reach.hops_to("car2").value() == 2U);
}

// -- requests for a greater number -----------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_node_whose_last_route_cannot_be_advertised_asks_for_a_greater_number_once) {
    reply("car2", {5, 1});
    BOOST_TEST(advert("far", "car1").value().hops.value() == 2U);
    reply("car1", {5, 2});
    BOOST_TEST(wanted("far").empty());
    reach.lose("car2", now);
    BOOST_TEST(wanted("far") == "[6,16]");
    reply("car1", {5, 3});
    BOOST_TEST(wanted("far").empty());
    reply("car1", {6, 3});
    BOOST_TEST(advert("far", "car9").value().hops.value() == 4U);
}

BOOST_AUTO_TEST_CASE(a_node_that_has_advertised_nothing_asks_for_nothing) {
    reply("car2", {5, 1});
    reach.lose("car2", now);
    BOOST_TEST(wanted("far").empty());
}

BOOST_AUTO_TEST_CASE(a_request_spreads_once_for_each_number_one_link_less_far) {
    reply("car2", {5, 1});
    ask("car1", 0xF, {6, 16});
    BOOST_TEST(wanted("far") == "[6,15]");
    ask("car1", 0xF, {6, 16});
    ask("car2", 0xF, {6, 9});
    BOOST_TEST(wanted("far").empty());
    ask("car2", 0xF, {7, 900});
    BOOST_TEST(wanted("far") == "[7,15]");
}

BOOST_AUTO_TEST_CASE(a_request_does_not_spread) {
    reply("car2", {5, 1});
    ask("car1", 0xF, {6, 1});            // over no further link
    ask("car1", 0xF, {6, std::nullopt}); // or over none at all
    ask("car1", 0xF, {10, 16});          // for a number that nobody needs
    ask("car1", 0x9, {6, 16});           // about a node that is not known
    routes = false;
    ask("car1", 0xF, {6, 16});
    BOOST_TEST(wanted("far").empty());
}

BOOST_AUTO_TEST_CASE(a_request_is_answered_by_a_node_with_a_route) {
    reply("car2", {6, 1});
    news();
    ask("car1", 0xF, {6, 16});
    BOOST_TEST(news().contains("far"));
    ask("car1", 0xF, {5, 16});
    const auto sent = news();
    BOOST_TEST(sent.contains("far"));
    BOOST_TEST(!sent.at("far"));
    ask("car2", 0xF, {6, 16}); // to which it would lead back
    BOOST_TEST(wanted("far") == "[6,15]");
}

BOOST_AUTO_TEST_CASE(a_route_that_was_asked_for_is_pushed_when_it_arrives) {
    reply("car2", {5, 1});
    ask("car1", 0xF, {6, 16});
    news();
    reply("car2", {5, 1});
    BOOST_TEST(news().empty());
    reply("car2", {6, 1});
    BOOST_TEST(news().contains("far"));
    reply("car2", {7, 1});
    BOOST_TEST(news().empty());
}

BOOST_AUTO_TEST_CASE(a_node_raises_its_number_when_it_is_asked_to_but_not_by_much) {
    cles::core::announcement said{.node = "me"};
    others.announce_self(said, 1, now);
    ask("car1", 0xA, {3, 16});
    BOOST_TEST(news().contains("me"));
    BOOST_TEST(advert("me", "car1").value().seq == 3U);
    ask("car1", 0xA, {2, 16});
    BOOST_TEST(news().contains("me"));
    BOOST_TEST(advert("me", "car1").value().seq == 3U);
    ask("car1", 0xA, {~std::uint64_t{0}, 16});
    BOOST_TEST(advert("me", "car1").value().seq == 5U);
}

// -- what follows ----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(feeds_leave_a_link_that_is_lost) {
    hear("car2", 0xC, {}, 2);
    reach.lose("car2", now);
    BOOST_TEST(lost.empty()); // it may have crashed: its link ends by itself
    now += 1s;
    hear("car2", 0xC, {}, 3);
    reach.review(now);
    reach.review(now);
    BOOST_TEST(lost == (std::vector<std::string>{"car2 by tcp://10.0.0.7:12"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(feeds_leave_a_link_that_the_links_of_a_node_exclude) {
    reply("car2", {5, 1});
    changed.clear();
    hear("car2", 0xC, {"car1"}, 2);
    reach.on_links_announced("car2");
    BOOST_TEST(lost == (std::vector<std::string>{"car2 by tcp://10.0.0.7:12", "far by tcp://10.0.0.7:12"}),
               boost::test_tools::per_element());
    BOOST_TEST(changed.contains("car2"));
    BOOST_TEST(changed.contains("far"));
    hear("car2", 0xC, {}, 3);
    lost.clear();
    reach.on_links_announced("car2");
    BOOST_TEST(lost.empty());
}

BOOST_AUTO_TEST_CASE(feeds_leave_links_that_this_node_gives_up) {
    reach.allow_only({"car1"});
    BOOST_TEST(lost == (std::vector<std::string>{"car2 by tcp://10.0.0.7:12"}), boost::test_tools::per_element());
    lost.clear();
    reach.allow_only({});
    BOOST_TEST(lost.empty());
    BOOST_TEST(changed.contains("car2"));
}

BOOST_AUTO_TEST_CASE(the_address_at_which_a_node_replied_is_preferred_to_one_that_others_report) {
    others.prefer_address("car1", "0000000b", "tcp://10.0.1.7:11");
    BOOST_TEST(others.address_of("car1").value() == "tcp://10.0.1.7:11");
    others.prefer_address("car1", "0000000b", "udp://10.0.1.7:11");
    others.prefer_address("car1", "0000000c", "tcp://10.0.2.7:11");
    BOOST_TEST(others.address_of("car1").value() == "tcp://10.0.1.7:11");
    others.prefer_address("nobody", "0000000b", "tcp://10.0.1.7:11");
}

BOOST_AUTO_TEST_CASE(a_list_of_links_is_a_need_everywhere) {
    BOOST_TEST(reach.need(now) == 0U);
    reach.allow_only({"car1"});
    reach.review(now);
    BOOST_TEST(reach.need(now) == 16U);
}

BOOST_AUTO_TEST_CASE(a_node_that_excludes_this_one_is_a_need_everywhere) {
    reach.review(now);
    BOOST_TEST(reach.need(now) == 16U);
}

BOOST_AUTO_TEST_CASE(a_link_that_has_just_been_lost_is_a_need_of_this_node_alone) {
    hear("far", 0xF, {}, 2);
    reach.review(now);
    BOOST_TEST(reach.need(now) == 0U);
    reach.lose("far", now);
    now += 1s;
    hear("far", 0xF, {}, 3);
    reach.review(now);
    BOOST_TEST(reach.need(now) == 1U);
    now += 3s;
    hear("far", 0xF, {}, 4);
    reach.review(now);
    BOOST_TEST(reach.need(now) == 16U);
}

BOOST_AUTO_TEST_CASE(the_need_of_others_spreads_one_link_less_far_and_is_forgotten) {
    hear("far", 0xF, {}, 2);
    reach.on_question({.distance = 5, .by = "car1"}, now);
    BOOST_TEST(reach.need(now) == 4U);
    reach.on_question({.distance = 2, .by = "car2"}, now);
    BOOST_TEST(reach.need(now) == 4U);
    BOOST_TEST(reach.need(now + 3999ms) == 4U);
    BOOST_TEST(reach.need(now + 4s) == 0U);
}

BOOST_AUTO_TEST_CASE(nothing_is_remembered_of_a_node_that_is_not_known) {
    reach.lose("nobody", now);
    BOOST_TEST(changed.empty());
}

BOOST_AUTO_TEST_CASE(another_incarnation_has_no_routes_yet) {
    reply("car2", {5, 1});
    reach.on_new_incarnation("far");
    BOOST_TEST(reach.next_hop_to("far", {}).empty());
}

BOOST_AUTO_TEST_CASE(a_node_to_which_no_link_can_be_opened_is_not_used) {
    reply("car2", {5, 1});
    reach.lose("car2", now);
    BOOST_TEST(reach.next_hop_to("far", {}).empty());
    reach.lose("nobody", now);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace
} // namespace reachability
