// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace gossip {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::gossip::client, cles::core::membership::watcher {
    fixture() { others.watch(this); }

    void ask(std::uint64_t ticket, const destination& at, const cles::core::table_question& what) override {
        asks.push_back({ticket, std::string{at.url}, std::string{what.since}, std::string{what.describe}});
    }
    void ask_description(std::uint64_t ticket, const destination& at) override {
        whos.push_back({ticket, std::string{at.url}, {}, {}});
    }
    void push(const destination& at, std::string_view table) override { pushed[std::string{at.url}] = table; }
    [[nodiscard]] bool forwards_for(std::string_view) const override { return true; }
    void on_seeds_heard() override { ++times_heard; }
    void release(const destination& at) override { released.insert(std::string{at.url}); }
    void on_peer(std::string_view node, cles::core::membership::change what, std::string_view where) override {
        if (what == cles::core::membership::change::gone) {
            gossip.on_gone(node, where, clock.now());
        }
    }

    struct asked {
        std::uint64_t ticket;
        std::string url;
        std::string since;
        std::string describe;
    };
    std::vector<asked> take_asks() { return std::exchange(asks, {}); }
    std::vector<asked> take_asks_within(std::chrono::milliseconds span) {
        take_asks();
        pass(span);
        return take_asks();
    }
    void pass(std::chrono::milliseconds by) {
        for (auto i = 0ms; i < by; i += 5ms) {
            clock.advance(5ms);
            deadlines.expire(clock.now());
        }
    }
    void begin(const std::vector<std::string>& seeds = {}) {
        gossip.set_seeds(seeds, clock.now());
        gossip.start(clock.now());
        deadlines.expire(clock.now());
    }
    static std::string url_of(int car) { return "tcp://10.0.0." + std::to_string(car) + ":1"; }
    static std::string name_of(int car) { return "car" + std::to_string(car); }
    static std::string entry(int car, int seq = 1) {
        return R"({"node":")" + name_of(car) + R"(","endpoints":[")" + url_of(car) + R"("],"epoch":"0000000)" +
               std::to_string(car) + R"(","seq":)" + std::to_string(seq) + R"(,"age_ms":0,"interval_ms":1000})";
    }
    static std::string answer(int by, const std::vector<int>& cars, const std::string& more = {}, int seq = 1) {
        std::string text =
            R"({"node":")" + name_of(by) + R"(","epoch":"0000000)" + std::to_string(by) + R"(","peers":[)";
        for (std::size_t i = 0; i < cars.size(); ++i) {
            text += (i == 0 ? "" : ",") + entry(cars[i], seq);
        }
        return text + R"(],"beats":{},"next":"0000000)" + std::to_string(by) + ".4\"" + more + "}";
    }
    /// A network of `cars` known nodes, of which all but `silent` answer every request, for `span`.
    void live_among(int cars, std::chrono::milliseconds span, const std::set<int>& silent = {}) {
        std::vector<int> all;
        for (int i = 1; i <= cars; ++i) {
            if (!silent.contains(i)) {
                all.push_back(i);
            }
        }
        for (auto i = 0ms; i < span; i += 50ms) {
            pass(50ms);
            for (const auto& a : take_asks()) {
                const int car = a.url[std::string{"tcp://10.0.0."}.size()] - '0';
                asked_count[car] += 1;
                if (!silent.contains(car)) {
                    gossip.on_answer(a.ticket, answer(car, all, {}, ++seq), clock.now());
                } else {
                    gossip.on_failure(a.ticket, clock.now());
                }
            }
        }
    }

    std::vector<asked> asks;
    std::vector<asked> whos;
    std::map<std::string, std::string> pushed;
    std::set<std::string> released;
    std::map<int, int> asked_count;
    int times_heard = 0;
    int seq = 1;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::counters counts;
    cles::core::membership others{"car5", 5, deadlines, 100};
    cles::core::gossip gossip{{"car5", "00000005"}, *this, others, counts, deadlines, 100, 7};
};

} // namespace
} // namespace gossip

BOOST_FIXTURE_TEST_SUITE(gossip, fixture)

BOOST_AUTO_TEST_CASE(no_node_is_asked_without_seeds) {
    begin();
    BOOST_TEST(take_asks_within(10s).empty());
}

BOOST_AUTO_TEST_CASE(seeds_are_asked_for_everything_at_start) {
    begin({url_of(1), url_of(2)});
    const auto all = take_asks();
    BOOST_REQUIRE(all.size() == 2U);
    BOOST_TEST(all[0].url == url_of(1));
    BOOST_TEST(all[0].since == "0");
    BOOST_TEST(all[1].url == url_of(2));
}

BOOST_AUTO_TEST_CASE(failed_seed_is_asked_again) {
    begin({url_of(1)});
    for (int i = 0; i < 5; ++i) {
        const auto all = take_asks();
        BOOST_REQUIRE(all.size() == 1U);
        gossip.on_failure(all[0].ticket, clock.now());
        asks.clear();
        pass(2s);
        asks.resize(std::min<std::size_t>(asks.size(), 1));
    }
    BOOST_TEST(counts.tables_failed == 5U);
}

BOOST_AUTO_TEST_CASE(new_nodes_are_asked_and_again_with_their_next) {
    begin({url_of(1)});
    gossip.on_answer(take_asks().front().ticket, answer(1, {1, 2}), clock.now());
    pass(200ms);
    std::set<std::string> urls;
    for (const auto& a : take_asks()) {
        urls.insert(a.url);
        BOOST_TEST(a.since == "0"); // also for the seed, which is a regular contact from now on
        gossip.on_answer(a.ticket, answer(a.url == url_of(1) ? 1 : 2, {1, 2}), clock.now());
    }
    BOOST_TEST(urls.size() == 2U);
    pass(300ms);
    const auto again = take_asks();
    BOOST_REQUIRE(!again.empty());
    BOOST_TEST(again[0].since == "0000000" + again[0].url.substr(std::string{"tcp://10.0.0."}.size(), 1) + ".4");
}

BOOST_AUTO_TEST_CASE(three_nodes_are_asked_one_of_them_the_successor) {
    begin({url_of(1)});
    live_among(9, 20s);
    const auto asked = gossip.asked();
    BOOST_TEST(asked.size() == 3U);
    BOOST_TEST((std::find(asked.begin(), asked.end(), "car6") != asked.end()));
    BOOST_TEST((std::find(asked.begin(), asked.end(), "car5") == asked.end()));
    BOOST_TEST(others.size() == 8U);
}

BOOST_AUTO_TEST_CASE(each_is_asked_every_eighth_of_an_interval_or_quarter_if_few_are_known) {
    begin({url_of(1)});
    live_among(9, 5s);
    asked_count.clear();
    live_among(9, 10s);
    // 125 ms less up to a quarter, in steps of 50 ms.
    BOOST_TEST(asked_count[6] >= 50);
    BOOST_TEST(asked_count[6] <= 110);
}

BOOST_AUTO_TEST_CASE(random_nodes_are_replaced_when_twice_as_many_are_known) {
    begin({url_of(1)});
    live_among(2, 2s); // two others, both of whom are asked
    asked_count.clear();
    released.clear();
    live_among(4, 2s);
    BOOST_TEST(!released.empty());
    BOOST_TEST(gossip.asked().size() == 3U);
}

BOOST_AUTO_TEST_CASE(own_entry_is_sent_with_the_first_request) {
    others.announce_self({.node = "car5", .endpoints = {"tcp://0.0.0.0:9"}}, 3, clock.now());
    begin({url_of(1)});
    BOOST_TEST(pushed[url_of(1)].find(R"("node":"car5","endpoints":["tcp://0.0.0.0:9"],"epoch":"00000005","seq":3)") !=
               std::string::npos);
}

BOOST_AUTO_TEST_CASE(node_that_is_not_asked_sends_its_own_entry) {
    others.announce_self({.node = "car5", .endpoints = {"tcp://0.0.0.0:9"}}, 3, clock.now());
    begin({url_of(1)});
    live_among(9, 2s);
    pushed.clear();
    for (int i = 0; i < 10; ++i) {
        std::string answer;
        cles::json_writer w{answer};
        gossip.write_delta(w, {.since = "0"}, 1U << 16U, clock.now());
        live_among(9, 200ms);
    }
    BOOST_TEST(pushed.empty());
    live_among(9, 1200ms);
    BOOST_TEST(pushed.size() == 1U);
}

BOOST_AUTO_TEST_CASE(node_that_fails_twice_is_replaced_and_released) {
    begin({url_of(1)});
    live_among(9, 5s);
    released.clear();
    live_among(9, 1s, {6});
    const auto asked = gossip.asked();
    BOOST_TEST((std::find(asked.begin(), asked.end(), "car6") == asked.end()));
    BOOST_TEST((std::find(asked.begin(), asked.end(), "car7") != asked.end())); // the successor after it
    BOOST_TEST(released.contains(url_of(6)));
    BOOST_TEST(asked.size() == 3U);
}

BOOST_AUTO_TEST_CASE(node_without_any_outcome_is_replaced_too) {
    begin({url_of(1)});
    BOOST_TEST(take_asks().size() == 1U);
    pass(5s); // even if the link does not report it
    BOOST_TEST(!take_asks().empty());
}

BOOST_AUTO_TEST_CASE(late_reply_is_not_read) {
    begin({url_of(1)});
    const auto ticket = take_asks().front().ticket;
    clock.advance(2001ms);
    gossip.on_answer(ticket, answer(1, {1, 2}), clock.now());
    BOOST_TEST(others.size() == 0U);
    BOOST_TEST(counts.tables_failed == 1U);
}

BOOST_AUTO_TEST_CASE(reply_that_is_not_a_table_is_a_failure) {
    begin({url_of(1)});
    gossip.on_answer(take_asks().front().ticket, R"({"value":7})", clock.now());
    BOOST_TEST(counts.tables_failed == 1U);
    gossip.on_answer(4711, answer(1, {1}), clock.now()); // not a ticket of this node
    BOOST_TEST(others.size() == 0U);
}

BOOST_AUTO_TEST_CASE(further_entries_are_requested_at_once) {
    begin({url_of(1)});
    gossip.on_answer(take_asks().front().ticket, answer(1, {1}, R"(,"more":true)"), clock.now());
    const auto again = take_asks_within(5ms);
    BOOST_REQUIRE(!again.empty());
    BOOST_TEST(again[0].url == url_of(1));
    BOOST_TEST(again[0].since == "00000001.4");
}

BOOST_AUTO_TEST_CASE(seed_that_is_this_node_is_not_asked_again) {
    begin({url_of(5)});
    gossip.on_answer(take_asks().front().ticket, answer(5, {5}), clock.now());
    BOOST_TEST(others.size() == 0U);
    BOOST_TEST(take_asks_within(30s).empty());
}

BOOST_AUTO_TEST_CASE(seed_is_asked_again_when_its_node_is_no_longer_live) {
    begin({url_of(1)});
    live_among(3, 5s);
    asked_count.clear();
    live_among(3, 20s, {1}); // removed
    BOOST_TEST(!others.address_of("car1").has_value());
    asked_count.clear();
    live_among(3, 20s, {1});
    BOOST_TEST(asked_count[1] >= 5);
    live_among(3, 5s); // it returns
    BOOST_TEST(others.address_of("car1").has_value());
}

BOOST_AUTO_TEST_CASE(removed_nodes_are_tried_so_that_a_partitioned_network_heals) {
    begin();
    gossip.on_pushed_table(R"({"peers":[)" + entry(1) + "," + entry(2) + "]}",
                           cles::core::observed_source::at(url_of(1)), clock.now());
    live_among(3, 5s);
    live_among(3, 30s, {2});
    BOOST_TEST(!others.address_of("car2").has_value());
    live_among(1, 20s, {1}); // the others are removed too: no node is known, and there are no seeds
    BOOST_TEST(others.size() == 0U);
    asked_count.clear();
    live_among(3, 10s);
    BOOST_TEST(others.size() == 3U);
}

BOOST_AUTO_TEST_CASE(unknown_node_that_sends_its_entry_is_asked_once) {
    begin();
    BOOST_TEST(gossip.on_pushed_table(R"({"peers":[)" + entry(1) + "]}", cles::core::observed_source::at(url_of(1)),
                                      clock.now()));
    const auto all = take_asks_within(200ms);
    BOOST_TEST(!all.empty());
    BOOST_TEST(all[0].url == url_of(1));
    BOOST_TEST(!gossip.on_pushed_table("[]", cles::core::observed_source::at(url_of(1)), clock.now()));
}

BOOST_AUTO_TEST_CASE(node_that_only_announces_itself_is_rarely_asked) {
    std::uint64_t sent = 0;
    const auto announces = [&] {
        others.apply_announcement({.node = "plain", .endpoints = {url_of(1)}}, 1, ++sent, {0x0A000001, 40000},
                                  clock.now());
    };
    announces();
    begin();
    std::size_t asked = 0;
    for (int i = 0; i < 600; ++i) { // one minute
        pass(100ms);
        if (i % 10 == 0) {
            announces();
        }
        for (const auto& a : take_asks()) {
            ++asked;
            gossip.on_answer(a.ticket, R"({"peers":[]})", clock.now());
        }
        for (const auto& a : std::exchange(whos, {})) {
            gossip.on_description(a.ticket, R"({"node":"plain","epoch":"00000001","endpoints":[")" + url_of(1) + "\"]}",
                                  clock.now());
        }
    }
    BOOST_TEST(asked <= 2U);
    others.apply_announcement({.node = "plain", .endpoints = {url_of(1)}}, 2, 1, {0x0A000001, 40001}, clock.now());
    pass(4s); // the first incarnation is silent
    others.apply_announcement({.node = "plain", .endpoints = {url_of(1)}}, 2, 2, {0x0A000001, 40001}, clock.now());
    BOOST_TEST(!take_asks_within(2s).empty()); // another incarnation may be another program
}

BOOST_AUTO_TEST_CASE(tables_of_another_pool_are_ignored) {
    others.begin("north", clock.now());
    begin({url_of(1)});
    gossip.on_answer(take_asks().front().ticket, answer(1, {1, 2}), clock.now());
    BOOST_TEST(others.size() == 0U);
    BOOST_TEST(take_asks_within(100ms).empty());
}

BOOST_AUTO_TEST_CASE(node_that_only_knows_plain_tables_takes_part) {
    begin({url_of(1)});
    const std::string plain =
        R"({"peers":[{"node":"car2","endpoints":["tcp://10.0.0.2:1"],"epoch":"00000002","age_ms":100,"state":"live","load":{}}]})";
    gossip.on_answer(take_asks().front().ticket, plain, clock.now());
    BOOST_TEST(others.address_of("car2").has_value());
    BOOST_REQUIRE(whos.size() == 1U);
    BOOST_TEST(whos[0].url == url_of(1));
    gossip.on_description(
        whos[0].ticket,
        R"({"node":"car1","version":"x","protocol":1,"epoch":"00000001","endpoints":["tcp://0.0.0.0:1"]})",
        clock.now());
    BOOST_TEST(std::string{others.address_of("car1").value_or("nowhere")} == url_of(1));
    BOOST_TEST(released.empty());
    // From then on it is asked regularly, for its whole table, and not too often.
    whos.clear();
    int tables = 0;
    for (int i = 0; i < 100; ++i) {
        for (const auto& a : take_asks_within(100ms)) {
            if (a.url == url_of(1)) {
                ++tables;
                BOOST_TEST(a.since == "0");
                gossip.on_answer(a.ticket, plain, clock.now());
                gossip.on_description(
                    whos.back().ticket,
                    R"({"node":"car1","version":"x","protocol":1,"epoch":"00000001","endpoints":["tcp://0.0.0.0:1"]})",
                    clock.now());
            } else {
                gossip.on_failure(a.ticket, clock.now());
            }
        }
    }
    BOOST_TEST(tables >= 8);
    BOOST_TEST(tables <= 25);
    BOOST_TEST(!others.find_member("car1")->suspect);
}

BOOST_AUTO_TEST_CASE(missing_description_is_requested) {
    begin({url_of(1)});
    live_among(3, 3s);
    for (const auto& a : take_asks_within(300ms)) {
        if (a.url == url_of(1)) {
            gossip.on_answer(
                a.ticket,
                R"({"node":"car1","epoch":"00000001","peers":[],"beats":{"00000009":[4,0,1000,0,0]},"next":"00000001.9"})",
                clock.now());
        }
    }
    for (const auto& a : take_asks_within(300ms)) {
        if (a.url == url_of(1)) {
            BOOST_TEST(a.since == "00000001.9");
            BOOST_TEST(a.describe == "00000009");
            return;
        }
    }
    BOOST_ERROR("car1 was not asked");
}

BOOST_AUTO_TEST_CASE(leave_is_sent_to_the_nodes_that_are_asked) {
    others.announce_self({.node = "car5", .endpoints = {"tcp://0.0.0.0:9"}}, 3, clock.now());
    begin({url_of(1)});
    live_among(9, 5s);
    pushed.clear();
    gossip.stop(clock.now());
    BOOST_TEST(pushed.size() == 3U);
    BOOST_TEST(pushed.begin()->second.find(R"("seq":4,"age_ms":0)") != std::string::npos);
    BOOST_TEST(pushed.begin()->second.find(R"("state":"left")") != std::string::npos);
    BOOST_TEST(take_asks_within(10s).empty());
}

// The leave could not be sent if the link had been released for another one to the same node.
BOOST_AUTO_TEST_CASE(leave_right_after_the_reply_of_a_seed_uses_the_same_link) {
    others.announce_self({.node = "car5", .endpoints = {"tcp://0.0.0.0:9"}}, 3, clock.now());
    begin({url_of(1)});
    gossip.on_answer(take_asks().front().ticket, answer(1, {1}), clock.now());
    BOOST_TEST(released.empty());
    pushed.clear();
    gossip.stop(clock.now());
    BOOST_REQUIRE(pushed.contains(url_of(1)));
    BOOST_TEST(pushed[url_of(1)].find(R"("state":"left")") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(leaving_node_keeps_asking_and_reports_itself_as_left) {
    others.announce_self({.node = "car5", .endpoints = {"tcp://0.0.0.0:9"}}, 3, clock.now());
    begin({url_of(1)});
    live_among(9, 5s);
    pushed.clear();
    gossip.leave(clock.now());
    BOOST_TEST(pushed.size() == 3U);
    asked_count.clear();
    live_among(9, 40s); // other random nodes are chosen meanwhile
    BOOST_TEST(asked_count[6] > 100);
    BOOST_TEST(others.size() == 8U);
    for (const auto& [url, table] : pushed) {
        BOOST_TEST(table.find(R"("state":"left")") != std::string::npos, url << " received " << table);
    }
    pushed.clear();
    gossip.leave(clock.now());
    gossip.stop(clock.now());
    BOOST_TEST(pushed.empty());
}

BOOST_AUTO_TEST_CASE(seeds_may_be_changed_while_it_runs) {
    begin({url_of(1)});
    take_asks();
    gossip.set_seeds({url_of(2)}, clock.now());
    const auto all = take_asks_within(5ms);
    BOOST_REQUIRE(all.size() == 1U);
    BOOST_TEST(all[0].url == url_of(2));
}

BOOST_AUTO_TEST_CASE(a_route_that_a_neighbour_pushes_is_used_and_pushed_to_the_others) {
    gossip.reach().allow_only({"car1", "car2"});
    begin({url_of(1), url_of(2)});
    live_among(3, 1s);
    pushed.clear();
    const auto push = [&](const std::string& epoch) {
        return gossip.on_pushed_table(R"({"node":"car1","epoch":")" + epoch +
                                          R"(","peers":[],"routes":{"00000003":[5,1]}})",
                                      {"10.0.0.1", false}, clock.now());
    };
    BOOST_TEST(push("00000009")); // another incarnation
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}).empty());
    BOOST_TEST(push("00000001"));
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}) == "car1");
    BOOST_TEST(pushed[url_of(2)] == R"({"node":"car5","epoch":"00000005","peers":[],"routes":{"00000003":[5,2]}})");
    BOOST_TEST(pushed[url_of(1)] == R"({"node":"car5","epoch":"00000005","peers":[],"routes":{"00000003":[5]}})");
}

BOOST_AUTO_TEST_CASE(a_number_that_a_neighbour_asks_for_is_asked_for_elsewhere) {
    gossip.reach().allow_only({"car1", "car2"});
    begin({url_of(1), url_of(2)});
    live_among(3, 1s);
    const auto ask = [&](int car, const std::string& wanted) {
        return gossip.on_pushed_table(R"({"node":")" + name_of(car) + R"(","epoch":"0000000)" + std::to_string(car) +
                                          R"(","peers":[],"wanted":)" + wanted + "}",
                                      {"10.0.0.1", false}, clock.now());
    };
    pushed.clear();
    BOOST_TEST(!ask(1, R"({"00000003":"soon"})"));
    BOOST_TEST(!ask(1, R"({"00000003":[]})"));
    BOOST_TEST(ask(3, R"({"00000003":[1,16]})")); // no neighbour
    BOOST_TEST(ask(1, R"({"nobody":[1,16]})"));
    BOOST_TEST(pushed.empty());
    BOOST_TEST(ask(1, R"({"00000003":[1,16]})"));
    BOOST_TEST(
        pushed[url_of(2)] ==
        R"({"node":"car5","epoch":"00000005","peers":[],"routes":{"00000003":[0]},"wanted":{"00000003":[1,15]}})");
}

BOOST_AUTO_TEST_CASE(seeds_are_heard_when_each_has_answered_or_refused) {
    begin({url_of(1), url_of(2)});
    auto first = take_asks();
    BOOST_REQUIRE(first.size() == 2U);
    gossip.on_answer(first[0].ticket, answer(1, {1}), clock.now());
    BOOST_TEST(times_heard == 0);
    gossip.on_failure(first[1].ticket, clock.now());
    BOOST_TEST(times_heard == 1);
}

BOOST_AUTO_TEST_CASE(a_seed_without_a_reply_in_time_has_not_been_heard) {
    begin({url_of(1)});
    const auto first = take_asks();
    BOOST_REQUIRE(first.size() == 1U);
    pass(2s);
    gossip.on_failure(first[0].ticket, clock.now());
    BOOST_TEST(times_heard == 0);
    auto next = take_asks();
    for (auto waited = 0ms; next.empty() && waited < 5s; waited += 50ms) {
        next = take_asks_within(50ms);
    }
    BOOST_REQUIRE(!next.empty());
    gossip.on_answer(next[0].ticket, answer(1, {1}), clock.now());
    BOOST_TEST(times_heard == 1);
}

BOOST_AUTO_TEST_CASE(a_seed_is_heard_with_the_last_page_of_its_table) {
    begin({url_of(1)});
    gossip.on_answer(take_asks().at(0).ticket, answer(1, {1}, R"(,"more":true)"), clock.now());
    BOOST_TEST(times_heard == 0);
    const auto next = take_asks_within(50ms);
    BOOST_REQUIRE(!next.empty());
    gossip.on_answer(next[0].ticket, answer(1, {2}), clock.now());
    BOOST_TEST(times_heard == 1);
}

BOOST_AUTO_TEST_SUITE_END()
