// SPDX-License-Identifier: BSL-1.0
// Gossip in a secured fleet (docs/protocol_security.md, "Announcements").
#include "node/membership/gossip.hpp"
#include "protocol/request_line.hpp"
#include "support/manual_clock.hpp"
#include "support/scripted_security.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace signed_gossip {
namespace {

using namespace std::chrono_literals;
using cles::core::observed_source;
using cles::test::scripted_security;

struct fixture : cles::core::gossip::client, cles::core::membership::watcher {
    fixture() {
        others.watch(this);
        others.set_prober([this](std::uint64_t ticket, std::string_view url) {
            probes.push_back(std::string{others.probed_name(ticket)} + " " + std::string{url});
            last_probe = ticket;
        });
    }

    void ask(std::uint64_t ticket, const destination& at, const cles::core::table_question& what) override {
        asks.push_back({ticket, std::string{at.url}, std::string{at.node}, what.routes.distance});
    }
    void ask_description(std::uint64_t, const destination&) override {}
    void push(const destination& at, std::string_view table) override {
        pushed[std::string{at.url} + " " + std::string{at.node}] = table;
    }
    void release(const destination&) override {}
    [[nodiscard]] bool forwards_for(std::string_view) const override { return true; }
    [[nodiscard]] bool may_forward(std::string_view node, std::string_view) const override {
        return forwarders.contains(node);
    }
    [[nodiscard]] bool is_member(std::string_view node) const override { return !removed.contains(node); }
    void on_stated_roster(std::string_view node, std::uint32_t version) override {
        rosters.push_back(std::string{node} + " " + std::to_string(version));
    }
    void on_peer(std::string_view node, cles::core::membership::change what, std::string_view) override {
        changes += what == cles::core::membership::change::clash ? std::string{node} + " clashes " : "";
    }

    /// The body of an announcement of car1.
    static std::string body(const std::string& endpoint = "tls://10.0.0.1:1", const std::string& more = {}) {
        return R"({"node":"car1","endpoints":[")" + endpoint + R"("],"tasks":"00")" + more + "}";
    }
    static std::string entry_with(const std::string& sig, std::uint64_t seq, const std::string& said,
                                  std::uint32_t epoch, int age) {
        return R"({"announced":)" + said + R"(,"seq":)" + std::to_string(seq) + R"(,"epoch":")" +
               cles::protocol::epoch_text(epoch) + R"(","sig":")" + sig + R"(","age_ms":)" + std::to_string(age) +
               R"(,"state":"live"})";
    }
    /// An entry as `by` signs it.
    static std::string entry(std::uint64_t seq, const std::string& said = body(), std::uint32_t epoch = 1, int age = 0,
                             const std::string& by = "car1") {
        return entry_with(scripted_security::signature(by, "cles", seq, cles::protocol::epoch_text(epoch), said), seq,
                          said, epoch, age);
    }
    static std::string table(const std::string& entries, const std::string& beats = {}) {
        return R"({"peers":[)" + entries + R"(],"beats":{)" + beats + "}}";
    }
    void hear(const std::string& entries, const std::string& by = "tls://10.0.0.9:1") {
        BOOST_TEST(gossip.on_pushed_table(table(entries), observed_source::at(by), clock.now()));
    }
    void hear_beat(std::uint64_t seq, std::uint32_t epoch = 1) {
        const auto beat = '"' + cles::protocol::epoch_text(epoch) + R"(":[)" + std::to_string(seq) + ",0,60000,3,4]";
        BOOST_TEST(gossip.on_pushed_table(table("", beat), observed_source::at("tls://10.0.0.9:1"), clock.now()));
    }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }
    [[nodiscard]] std::string where(std::string_view node = "car1") const {
        const auto found = others.address_of(node);
        return found ? std::string{*found} : "nowhere";
    }
    [[nodiscard]] std::string told(std::size_t longest = 30'000) {
        std::string out;
        cles::json_writer w{out};
        gossip.write_delta(w, {.since = "0"}, longest, clock.now());
        return out;
    }
    [[nodiscard]] bool tells(const std::string& part) { return told().find(part) != std::string::npos; }

    struct asked {
        std::uint64_t ticket;
        std::string url;
        std::string node;
        unsigned distance;
    };
    /// The nodes car1 and car2 are known, which do not have a link to car3, and car1 is asked for routes.
    asked begin_routes() {
        const auto of = [](const std::string& name, const std::string& more) {
            return R"({"node":")" + name + R"(","endpoints":["tls://10.0.0.)" + name.substr(3) +
                   R"(:1"],"tasks":"00")" + more + "}";
        };
        hear(entry(1, of("car1", ""), 1));
        hear(entry(1, of("car2", ""), 2, 0, "car2"));
        hear(entry(1, of("car3", R"(,"links":["car1","car2"])"), 3, 0, "car3"));
        gossip.reach().allow_only({"car1", "car2"});
        gossip.start(clock.now());
        pass(5ms);
        for (const auto& each : asks) {
            if (each.node == "car1") {
                return each;
            }
        }
        BOOST_ERROR("car1 is not asked");
        return {};
    }
    /// A table of car1 with a route to car3.
    static std::string routes(const std::string& more = R"(,"next":"00000001.9")") {
        return R"({"node":"car1","epoch":"00000001","peers":[],"beats":{},"routes":{"00000003":[5,1]})" + more + "}";
    }
    bool push_routes(const observed_source& by) { return gossip.on_pushed_table(routes(""), by, clock.now()); }

    std::vector<asked> asks;
    std::map<std::string, std::string> pushed;                     // by URL and node
    std::set<std::string, std::less<>> forwarders{"car1", "car2"}; // that may forward for this node
    std::set<std::string, std::less<>> removed;
    std::vector<std::string> rosters;
    std::vector<std::string> probes;
    std::uint64_t last_probe = 0;
    std::string changes;
    scripted_security security;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::counters counts;
    cles::core::membership others{"car5", 5, deadlines, 100};
    cles::core::gossip gossip{{"car5", "00000005"}, *this, others, counts, deadlines, 100, 7, &security};
};

} // namespace
} // namespace signed_gossip

BOOST_FIXTURE_TEST_SUITE(signed_gossip, fixture)

BOOST_AUTO_TEST_CASE(an_entry_is_passed_on_as_it_was_signed) {
    const auto said = R"({ "node":"car1", "endpoints":["tls://10.0.0.1:1"], "later":[1.50] })";
    hear(entry(17, said, 0x5f3a09c1, 240));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    BOOST_TEST(counts.entries_dropped == 0U);
    pass(60ms);
    BOOST_TEST(tells("[" + entry(17, said, 0x5f3a09c1, 300) + "]"), told());
}

BOOST_AUTO_TEST_CASE(entries_without_a_valid_signature_are_dropped_and_counted) {
    const auto valid = scripted_security::signature("car1", "cles", 7, "00000001", body());
    const std::vector<std::string> bad{
        R"({"node":"car1","endpoints":["tls://10.0.0.1:1"],"epoch":"00000001","seq":7,"age_ms":0})",
        R"({"announced":)" + body() + R"(,"seq":7,"epoch":"00000001","age_ms":0})",
        R"({"seq":7,"epoch":"00000001","sig":")" + valid + R"(","age_ms":0})",
        entry_with("", 7, body(), 1, 0),
        entry_with("x", 7, body(), 1, 0),
        entry_with(valid, 8, body(), 1, 0),                   // another seq
        entry_with(valid, 7, body(), 2, 0),                   // another epoch
        entry_with(valid, 7, body("tls://10.0.0.2:1"), 1, 0), // another address
        entry(7, body(), 1, 0, "car2"),                       // signed by another member
        entry(0),
        entry(7, R"({"endpoints":[]})"),
        entry(7, R"({"node":"all"})"),
        entry(7, R"("car1")"),
    };
    std::uint64_t dropped = 0;
    for (const auto& each : bad) {
        hear(each);
        BOOST_TEST(counts.entries_dropped == ++dropped, each);
        BOOST_TEST(where() == "nowhere", each);
    }
    hear(entry(7));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
}

BOOST_AUTO_TEST_CASE(the_greatest_signed_seq_decides_the_address) {
    hear(entry(7, R"({"node":"car1","endpoints":["tls://10.0.0.1:1","tls://10.0.0.2:1"]})"));
    hear(entry(8, body("tls://10.0.0.3:1")));
    BOOST_TEST(where() == "tls://10.0.0.3:1");
    pass(2s);
    hear(entry(7, R"({"node":"car1","endpoints":["tls://10.0.0.1:1","tls://10.0.0.2:1"]})"));
    BOOST_TEST(where() == "tls://10.0.0.3:1");
    hear(entry_with("x", 9, body("tls://10.0.0.4:1"), 1, 0));
    BOOST_TEST(where() == "tls://10.0.0.3:1");
}

BOOST_AUTO_TEST_CASE(a_forged_seq_does_not_keep_a_node_out) {
    hear(entry(7));
    hear(entry_with("x", 999'999, body(), 1, 0));
    pass(600ms);
    hear_beat(999'999);
    hear(entry(8, body("tls://10.0.0.2:1"), 1, 500));
    BOOST_TEST(where() == "tls://10.0.0.2:1");
    BOOST_TEST(tells(R"("seq":8,)"), told());
}

BOOST_AUTO_TEST_CASE(hints_make_a_node_younger_and_change_its_load_only) {
    hear(entry(7));
    pass(3s);
    hear_beat(12);
    auto listed = others.list(clock.now());
    BOOST_TEST((listed[0].age == 0ms));
    BOOST_TEST(listed[0].load.queued == 3U);
    BOOST_TEST(listed[0].load.running == 4U);
    pass(3s);
    hear(entry(7)); // the same one, but its node was alive
    BOOST_TEST((others.list(clock.now())[0].age == 0ms));
    BOOST_TEST(tells(R"("seq":7,)"), told());
    pass(3600ms); // the interval in the hint does not count
    BOOST_TEST((others.list(clock.now())[0].state == cles::peer_state::suspect));
    hear(entry(7, body(), 1, 3500)); // no news
    BOOST_TEST((others.list(clock.now())[0].age == 3600ms));
}

BOOST_AUTO_TEST_CASE(only_the_node_itself_announces_that_it_leaves) {
    hear(entry(7));
    auto forged = entry(7);
    forged.replace(forged.find("\"live\""), 6, "\"left\"");
    pass(600ms);
    hear(forged);
    hear(entry_with("x", 8, body("tls://10.0.0.1:1", R"(,"leaving":true)"), 1, 0));
    hear(entry(8, body("tls://10.0.0.1:1", R"(,"leaving":true)"), 1, 0, "car2"));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    hear(entry(6, body("tls://10.0.0.1:1", R"(,"leaving":true)"))); // before it said something else
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    const auto left = body("tls://10.0.0.1:1", R"(,"leaving":true)");
    hear(entry(8, left));
    BOOST_TEST(where() == "nowhere");
    auto relayed = entry(8, left);
    relayed.replace(relayed.find("\"live\""), 6, "\"left\"");
    BOOST_TEST(tells(relayed), told());
    hear(entry(7)); // what it announced before
    hear_beat(9);
    BOOST_TEST(where() == "nowhere");
}

BOOST_AUTO_TEST_CASE(a_node_that_was_received_in_the_group_may_leave_by_gossip) {
    cles::core::announcement said{.node = "car1", .endpoints = {"tls://10.0.0.1:1"}};
    said.original = std::make_shared<cles::core::signed_announcement>();
    others.apply_announcement(said, 1, 7, {0x0A000001, 40000}, clock.now());
    hear(entry(8, body("tls://10.0.0.1:1", R"(,"leaving":true)")));
    BOOST_TEST(where() == "nowhere");
}

BOOST_AUTO_TEST_CASE(a_node_that_is_no_longer_received_in_the_group_moves_by_gossip) {
    cles::core::announcement said{.node = "car1", .endpoints = {"tls://10.0.0.1:1"}};
    said.original = std::make_shared<cles::core::signed_announcement>();
    others.apply_announcement(said, 1, 7, {0x0A000001, 40000}, clock.now());
    hear(entry(8, body("tls://10.0.0.2:1")));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    pass(4s);
    hear(entry(9, body("tls://10.0.0.2:1")));
    BOOST_TEST(where() == "tls://10.0.0.2:1");
}

BOOST_AUTO_TEST_CASE(an_announcement_of_an_earlier_incarnation_moves_nothing) {
    hear(entry(3));
    const auto earlier = body("tls://10.0.0.66:1");
    hear(entry(99, earlier, 2));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    BOOST_REQUIRE(probes.size() == 1U); // the node of that name is asked, and no other
    BOOST_TEST(probes[0] == "car1 tls://10.0.0.1:1");
    others.on_probed(last_probe,
                     {.what = cles::core::probe_outcome::kind::answered, .node = "car1", .epoch = 1, .uptime = 1s},
                     clock.now());
    BOOST_REQUIRE(probes.size() == 2U);
    BOOST_TEST(probes[1] == "car1 tls://10.0.0.66:1");
    others.on_probed(last_probe, {.what = cles::core::probe_outcome::kind::unclear}, clock.now());
    for (int i = 0; i < 20; ++i) { // hints are no proof that both are live
        pass(600ms);
        hear_beat(3);
        hear_beat(99, 2);
        hear(entry(99, earlier, 2));
    }
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    BOOST_TEST(changes.empty(), changes);
}

BOOST_AUTO_TEST_CASE(another_member_does_not_end_an_incarnation_by_its_epoch) {
    hear(entry(1));
    const std::string mine = R"({"node":"car2","endpoints":["tls://10.0.0.2:1"]})";
    const std::string left = R"({"node":"car2","endpoints":[],"leaving":true})";
    hear(entry(50, mine, 1, 0, "car2"));
    hear(entry(51, left, 1, 0, "car2"));
    pass(700ms);
    hear(entry(2, body("tls://10.0.0.3:1")));
    BOOST_TEST(where() == "tls://10.0.0.3:1");
}

BOOST_AUTO_TEST_CASE(a_silent_node_that_was_alive_later_is_known_again) {
    hear(entry(7));
    pass(16s);
    BOOST_TEST(where() == "nowhere");
    hear(entry(6));
    BOOST_TEST(where() == "nowhere");
    hear(entry(7));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
}

BOOST_AUTO_TEST_CASE(endpoints_that_mean_something_else_elsewhere_do_not_count) {
    const std::string all =
        R"("tls://0.0.0.0:1","tls://[::]:1","unix:///tmp/s","tls://127.0.0.1:1","tls://[::1]:1","tls://10.0.0.1:1")";
    const auto said = R"({"node":"car1","endpoints":[)" + all + "]}";
    hear(entry(1, said));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    hear(entry(2, said), "tls://127.0.0.1:9");
    BOOST_TEST((others.list(clock.now())[0].endpoints ==
                std::vector<std::string>{"tls://10.0.0.1:1", "tls://127.0.0.1:1", "tls://[::1]:1"}));
    BOOST_TEST(tells(all));
    hear(entry(3, body("tls://127.0.0.1:1")), "tls://127.0.0.1:9");
    BOOST_TEST(where() == "tls://127.0.0.1:1");
}

BOOST_AUTO_TEST_CASE(a_known_node_is_asked_by_name_and_its_routes_count) {
    const auto car1 = begin_routes();
    BOOST_TEST(car1.url == "tls://10.0.0.1:1");
    BOOST_TEST(car1.distance == 16U);
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}).empty());
    gossip.on_answer(car1.ticket, routes(), clock.now());
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}) == "car1");
    BOOST_TEST(pushed["tls://10.0.0.2:1 car2"].find(R"("routes":{"00000003":[5,2]})") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(routes_from_an_address_without_a_name_do_not_count) {
    begin_routes();
    asks.clear();
    gossip.set_seeds({"tls://10.0.0.9:1"}, clock.now());
    pass(5ms);
    BOOST_REQUIRE(!asks.empty());
    BOOST_TEST(asks.back().url == "tls://10.0.0.9:1");
    BOOST_TEST(asks.back().node.empty());
    gossip.on_answer(asks.back().ticket, routes(), clock.now());
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}).empty());
}

BOOST_AUTO_TEST_CASE(routes_that_are_pushed_count_only_on_a_link_of_their_node) {
    begin_routes();
    BOOST_TEST(push_routes(observed_source::at("tls://10.0.0.1:1"))); // anybody's
    BOOST_TEST(push_routes({.host = "10.0.0.1", .local = false, .name = "car2"}));
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}).empty());
    BOOST_TEST(push_routes({.host = "10.0.0.1", .local = false, .name = "car1"}));
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}) == "car1");
}

BOOST_AUTO_TEST_CASE(routes_of_a_member_that_may_not_forward_do_not_count) {
    forwarders.erase("car1");
    begin_routes();
    BOOST_TEST(push_routes({.host = "10.0.0.1", .local = false, .name = "car1"}));
    BOOST_TEST(gossip.reach().next_hop_to("car3", {}).empty());
}

BOOST_AUTO_TEST_CASE(of_several_announced_addresses_the_one_that_answers_is_preferred) {
    hear(entry(7, R"({"node":"car1","endpoints":["tls://10.0.0.1:1","tls://10.0.0.2:1"]})"));
    others.prefer_address("car1", "00000001", "tls://10.0.0.3:1", true);
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    others.prefer_address("car1", "00000001", "tls://10.0.0.2:1", true);
    BOOST_TEST(where() == "tls://10.0.0.2:1");
}

BOOST_AUTO_TEST_CASE(the_address_at_which_a_seed_has_replied_is_preferred) {
    cles::core::seeds configured{7};
    configured.set({"tls://10.0.0.2:1", "tls://10.0.0.3:1", "tls://10.0.0.1:1"});
    configured.on_answer("tls://10.0.0.2:1", "car1");
    configured.on_answer("tls://10.0.0.3:1", "car1");
    configured.prefer_in(others); // it is not known yet
    hear(entry(7, R"({"node":"car1","endpoints":["tls://10.0.0.1:1","tls://10.0.0.2:1"]})"));
    BOOST_TEST(where() == "tls://10.0.0.1:1");
    configured.prefer_in(others);
    BOOST_TEST(where() == "tls://10.0.0.2:1"); // it has not announced the other
    configured.on_answer("tls://10.0.0.1:1", "car1");
    others.prefer_address("car1", "00000001", "tls://10.0.0.1:1", true);
    configured.prefer_in(others);
    BOOST_TEST(where() == "tls://10.0.0.1:1"); // one of them is in use already
}

BOOST_AUTO_TEST_CASE(the_stated_roster_is_reported) {
    hear(entry(1, body("tls://10.0.0.1:1", R"(,"roster":8)")));
    hear(entry_with("x", 2, body("tls://10.0.0.1:1", R"(,"roster":9)"), 1, 0));
    BOOST_REQUIRE(rosters.size() == 1U);
    BOOST_TEST(rosters[0] == "car1 8");
}

BOOST_AUTO_TEST_CASE(an_entry_too_large_for_the_reply_is_left_out) {
    hear(entry(1, body("tls://10.0.0.1:1", R"(,"x":")" + std::string(800, 'x') + "\"")));
    hear(entry(1, R"({"node":"car2","endpoints":["tls://10.0.0.2:1"]})", 2, 0, "car2"));
    const auto small = told(900);
    BOOST_TEST(small.size() <= 900U);
    BOOST_TEST(small.find("car2") != std::string::npos, small);
    BOOST_TEST(small.find("more") == std::string::npos, small);
    BOOST_TEST(tells("car1"));
}

BOOST_AUTO_TEST_CASE(entries_are_bounded) {
    hear(entry(1, body("tls://10.0.0.1:1", R"(,"x":")" + std::string(1200, 'x') + "\"")));
    BOOST_TEST(counts.entries_dropped == 1U);
    const auto deep = entry(1, body("tls://10.0.0.1:1", R"(,"x":)" + std::string(100, '[') + std::string(100, ']')));
    BOOST_TEST(!gossip.on_pushed_table(table(deep), observed_source::at("tls://10.0.0.9:1"), clock.now()));
    BOOST_TEST(where() == "nowhere");
}

BOOST_AUTO_TEST_CASE(own_entry_is_new_only_if_more_than_its_load_has_changed) {
    cles::core::announcement own{.node = "car5", .endpoints = {"tls://10.0.0.5:1"}, .roster = 7};
    BOOST_TEST(others.has_news(own));
    others.announce_self(own, 1, clock.now());
    own.load.queued = 5;
    own.interval = 2s;
    BOOST_TEST(!others.has_news(own));
    auto changed = own;
    changed.roster = 8;
    BOOST_TEST(others.has_news(changed));
    changed = own;
    changed.endpoints.clear();
    BOOST_TEST(others.has_news(changed));
    changed = own;
    changed.leaving = true;
    BOOST_TEST(others.has_news(changed));
}

BOOST_AUTO_TEST_SUITE_END()
