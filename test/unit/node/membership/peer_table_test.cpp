// SPDX-License-Identifier: BSL-1.0
#include "node/membership/peer_table.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace peer_table {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::peer_heartbeat;
using cles::core::peer_report;

constexpr group_source here{0x0A000007, 40000};

struct fixture {
    static announcement make_announcement(std::string node, std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = std::move(node), .endpoints = {std::move(endpoint)}, .tasks = "00"};
    }
    void receive(const std::string& node, std::uint32_t epoch, std::uint64_t seq) {
        table.apply_announcement(make_announcement(node), epoch, seq, here, clock.now());
    }
    std::string delta(const std::string& since, std::size_t longest = 1U << 20U, std::string_view describe = {}) {
        std::string out;
        cles::json_writer w{out};
        write_delta(w, {"me", "0000aaaa"}, table, {since, describe}, longest, clock.now());
        return out;
    }
    /// Reads a reply, and returns the `since` for the next request.
    std::string read(const std::string& json) {
        good = read_table(json, 100, 7s, got);
        reports = got.reports;
        beats = got.beats;
        return got.next;
    }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::membership table{"me", 0xAAAA, deadlines, 100};
    std::vector<peer_report> reports;
    std::vector<peer_heartbeat> beats;
    bool good = false;
    cles::core::peer_table got;
};

} // namespace
} // namespace peer_table

BOOST_FIXTURE_TEST_SUITE(peer_table, fixture)

BOOST_AUTO_TEST_CASE(first_reply_has_everything_later_ones_only_changes) {
    auto said = make_announcement("car1");
    said.load = {.queued = 1, .running = 2, .workers = 3};
    table.apply_announcement(said, 0x5F3A09C1, 17, here, clock.now());
    clock.advance(240ms);
    BOOST_TEST(delta("0") ==
               R"({"node":"me","epoch":"0000aaaa","peers":[{"node":"car1","endpoints":["tcp://10.0.0.7:1"],)"
               R"("epoch":"5f3a09c1","seq":17,"age_ms":240,"interval_ms":1000,"state":"live",)"
               R"("load":{"queued":1,"running":2,"workers":3},"tasks":"00"}],"beats":{},"next":"0000aaaa.2"})");
    said.load.running = 5;
    table.apply_announcement(said, 0x5F3A09C1, 18, here, clock.now());
    clock.advance(90ms);
    BOOST_TEST(delta("0000aaaa.2") ==
               R"({"node":"me","epoch":"0000aaaa","peers":[],"beats":{"5f3a09c1":[18,90,1000,1,5]},)"
               R"("next":"0000aaaa.3"})");
    BOOST_TEST(delta("0000aaaa.3") == R"({"node":"me","epoch":"0000aaaa","peers":[],"beats":{},"next":"0000aaaa.3"})");
}

BOOST_AUTO_TEST_CASE(unknown_value_of_since_counts_as_none) {
    receive("car1", 1, 1);
    for (const auto* since : {"0", "1", "0000bbbb.2", "0000aaaa.999", "0000aaaa.", "0000aaaa.x", "0000aaaa", "-"}) {
        read(delta(since));
        BOOST_TEST(reports.size() == 1U, since);
    }
}

BOOST_AUTO_TEST_CASE(changed_number_of_workers_needs_a_description) {
    receive("car1", 1, 1);
    const auto since = read(delta("0"));
    auto said = make_announcement("car1");
    said.load.workers = 8;
    table.apply_announcement(said, 1, 2, here, clock.now());
    read(delta(since));
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].announced.load.workers == 8U);
    BOOST_TEST(beats.empty());
}

BOOST_AUTO_TEST_CASE(much_longer_service_time_needs_a_description) {
    auto said = make_announcement("car1");
    std::uint64_t seq = 0;
    const auto is_described = [&](std::uint32_t service_us) {
        const auto since = read(delta("0"));
        said.load.service_us = service_us;
        table.apply_announcement(said, 1, ++seq, here, clock.now());
        read(delta(since));
        BOOST_TEST(reports.size() + beats.size() == 1U);
        return !reports.empty();
    };
    is_described(1'000);               // it appears
    BOOST_TEST(!is_described(49'999)); // differences between fast nodes do not matter
    BOOST_TEST(is_described(150'000));
    BOOST_TEST(!is_described(400'000));
    BOOST_TEST(is_described(800'000));
    BOOST_TEST(is_described(2'000));
    BOOST_TEST(is_described(50'000));
    // The same holds for this node's own entry.
    const auto speaks = [&](std::uint32_t service_us) {
        const auto since = read(delta("0"));
        table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}, .load = {.service_us = service_us}}, ++seq,
                            clock.now());
        read(delta(since));
        return reports.size() == 1U;
    };
    speaks(1'000);
    BOOST_TEST(!speaks(2'000));
    BOOST_TEST(speaks(200'000));
    BOOST_TEST(!speaks(300'000));
    BOOST_TEST(speaks(1'000));
}

BOOST_AUTO_TEST_CASE(replying_node_is_included_if_it_announces_itself) {
    table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}}, 1, clock.now());
    read(delta("0"));
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].announced.node == "me");
    BOOST_TEST(reports[0].announced.endpoints.front() == "tcp://0.0.0.0:9");
    BOOST_TEST(got.node == "me");
    BOOST_TEST(got.epoch == "0000aaaa");
}

BOOST_AUTO_TEST_CASE(descriptions_are_sent_again_on_request) {
    receive("car1", 1, 1);
    receive("car2", 2, 1);
    receive("car3", 3, 1);
    const auto since = read(delta("0"));
    receive("car2", 2, 2);
    const auto next = read(delta(since, 1U << 20U, "00000001,00000002,00000009"));
    BOOST_REQUIRE(reports.size() == 2U);
    BOOST_TEST(reports[0].announced.node == "car1");
    BOOST_TEST(reports[1].announced.node == "car2");
    BOOST_TEST(beats.empty());
    read(delta(next));
    BOOST_TEST(reports.empty());
}

BOOST_AUTO_TEST_CASE(left_nodes_are_reported_as_left) {
    receive("car1", 1, 1);
    const auto since = read(delta("0"));
    table.apply_announcement({.node = "car1", .leaving = true}, 1, 2, here, clock.now());
    clock.advance(5ms);
    const auto reply = delta(since);
    BOOST_TEST(reply.find(R"("peers":[{"node":"car1","epoch":"00000001","seq":2,"age_ms":5,"state":"left"}])") !=
               std::string::npos);
    read(reply);
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].announced.leaving);
    clock.advance(15s);
    read(delta(since)); // its tombstone has expired
    BOOST_TEST(reports.empty());
}

BOOST_AUTO_TEST_CASE(node_that_has_left_reports_itself_as_left) {
    table.leave(clock.now()); // it has not announced itself yet
    BOOST_TEST(delta("0").find("\"peers\":[]") != std::string::npos);
    table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}}, 1, clock.now());
    const auto since = read(delta("0"));
    table.leave(clock.now());
    for (const auto& reply : {delta("0"), delta(since)}) {
        BOOST_TEST(reply.find(R"("peers":[{"node":"me","epoch":"0000aaaa","seq":2,"age_ms":0,"state":"left"}])") !=
                   std::string::npos);
    }
    const auto next = read(delta(since));
    table.leave(clock.now());
    BOOST_TEST(delta(next).find("\"peers\":[]") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(two_incarnations_of_one_epoch_are_always_described) {
    receive("car1", 7, 1);
    receive("car2", 7, 1);
    const auto since = read(delta("0"));
    receive("car1", 7, 2);
    read(delta(since));
    BOOST_TEST(beats.empty());
    BOOST_TEST(reports.size() == 1U);
}

BOOST_AUTO_TEST_CASE(entries_that_do_not_fit_follow_in_the_next_reply) {
    for (std::uint32_t i = 1; i <= 50; ++i) {
        receive("car" + std::to_string(i), i, 1);
    }
    std::string since = "0";
    std::size_t entries = 0;
    std::size_t answers = 0;
    do {
        const auto reply = delta(since, 1200);
        BOOST_TEST(reply.size() <= 1200U);
        since = read(reply);
        BOOST_TEST(!reports.empty());
        entries += reports.size();
        ++answers;
        BOOST_REQUIRE(answers < 50U);
    } while (got.more);
    BOOST_TEST(entries == 50U);
    BOOST_TEST(answers > 5U);
}

BOOST_AUTO_TEST_CASE(entry_that_does_not_fit_has_fewer_endpoints) {
    announcement said{.node = "car1"};
    said.endpoints.assign(16, "unix://@" + std::string(100, 'a'));
    table.apply_announcement(said, 1, 1, {0x7F000001, 1}, clock.now());
    const auto reply = delta("0", 1200);
    BOOST_TEST(reply.size() <= 1200U);
    read(reply);
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].announced.endpoints.size() < 16U);
    BOOST_TEST(!reports[0].announced.endpoints.empty());
    BOOST_TEST(!got.more);
}

BOOST_AUTO_TEST_CASE(entry_keys_are_read_in_any_order_and_unknown_ones_skipped) {
    read(R"({"x":{"y":[1]},"peers":[{"z":1,"load":{"running":2,"queued":1},"state":"suspect","age_ms":7,)"
         R"("epoch":"0000000a","endpoints":["tcp://1.2.3.4:5"],"node":"car1"}]})");
    BOOST_TEST(good);
    BOOST_REQUIRE(reports.size() == 1U);
    const auto& r = reports[0];
    BOOST_TEST(r.announced.node == "car1");
    BOOST_TEST(r.epoch == 10U);
    BOOST_TEST(r.seq == 0U);
    BOOST_TEST((r.age == 7ms));
    BOOST_TEST((r.announced.interval == 7s)); // it has none
    BOOST_TEST(r.announced.load.running == 2U);
    BOOST_TEST(got.next.empty()); // a plain table
}

BOOST_AUTO_TEST_CASE(only_a_malformed_entry_is_skipped) {
    for (const auto* wrong :
         {R"({"node":7,"epoch":"00000001"})", R"({"node":"car2"})", R"({"node":"car2","epoch":"1"})",
          R"({"node":"car 2","epoch":"00000001"})", R"({"node":"all","epoch":"00000001"})", R"({"epoch":"00000001"})",
          R"({"node":"car2","epoch":"00000001","age_ms":-1})", R"({"node":"car2","epoch":"00000001","load":[]})", "7",
          "[]"}) {
        read(R"({"peers":[)" + std::string{wrong} + R"(,{"node":"car1","epoch":"00000001"}]})");
        BOOST_TEST(good, wrong);
        BOOST_TEST(got.bad_entries == 1U, wrong);
        BOOST_TEST(reports.size() == 1U, wrong);
    }
}

BOOST_AUTO_TEST_CASE(json_that_is_not_a_table_is_refused) {
    for (const auto* wrong :
         {"", "[]", "7", "{}", R"({"peers":7})", R"({"peers":[)", R"({"peers":[],"beats":[]})",
          R"({"peers":[],"beats":{"00000001":[1,2]}})", R"({"peers":[],"next":7})", R"({"peers":[],"more":1})"}) {
        read(wrong);
        BOOST_TEST(!good, wrong);
    }
}

BOOST_AUTO_TEST_CASE(heartbeats_may_have_more_values_and_their_keys_are_epochs) {
    read(R"({"peers":[],"beats":{"0000000a":[3,40,2000,5,6,"more"],"car1":[1]}})");
    BOOST_TEST(good);
    BOOST_REQUIRE(beats.size() == 1U);
    BOOST_TEST(beats[0].epoch == 10U);
    BOOST_TEST(beats[0].seq == 3U);
    BOOST_TEST((beats[0].age == 40ms));
    BOOST_TEST((beats[0].interval == 2s));
    BOOST_TEST(beats[0].queued == 5U);
    BOOST_TEST(beats[0].running == 6U);
}

BOOST_AUTO_TEST_CASE(number_of_entries_is_bounded) {
    std::string text = R"({"peers":[)";
    for (int i = 0; i < 150; ++i) {
        text += std::string{i == 0 ? "" : ","} + R"({"node":"car1","epoch":"00000001"})";
    }
    read(text + "]}");
    BOOST_TEST(good);
    BOOST_TEST(reports.size() == 100U);
}

BOOST_AUTO_TEST_CASE(link_local_addresses_are_told_to_those_on_the_link) {
    const auto by_link = cles::core::observed_source::at("tcp://[fe80::bb%25eth1]:1");
    const peer_report report{.announced = make_announcement("car1", "tcp://[::]:1"), .epoch = 1, .seq = 7};
    table.apply_gossip(report, by_link, clock.now(), clock.now());
    BOOST_TEST(*table.address_of("car1") == "tcp://[fe80::bb%25eth1]:1");
    const auto told_to = [&](std::string_view zone) {
        std::string out;
        cles::json_writer w{out};
        write_delta(w, {"me", "0000aaaa"}, table, {.since = "0", .zone = zone}, 1U << 20U, clock.now());
        read(out);
        BOOST_REQUIRE(reports.size() == 1U);
        return reports.front().announced.endpoints;
    };
    BOOST_TEST(told_to("eth1") == (std::vector<std::string>{"tcp://[fe80::bb]:1"}), boost::test_tools::per_element());
    BOOST_TEST(told_to("eth0").empty());
    BOOST_TEST(told_to({}).empty());

    // Another node, which reaches this one by a link of another name.
    told_to("eth1");
    cles::core::membership other{"other", 0xBBBB, deadlines, 100};
    other.apply_gossip(reports.front(), cles::core::observed_source::at("tcp://[fe80::aa%25wlan0]:1"), clock.now(),
                       clock.now());
    BOOST_TEST(*other.address_of("car1") == "tcp://[fe80::bb%25wlan0]:1");
}

BOOST_AUTO_TEST_CASE(own_entry_is_written) {
    std::string out;
    cles::json_writer w{out};
    const auto said = make_announcement("car1");
    cles::core::incarnation own;
    own.epoch = 0x0A0B0C0D;
    own.seq = 3;
    own.last_seen = clock.now() - 4ms;
    own.announced = said;
    own.relayed_endpoints = said.endpoints;
    write_own_entry(w, own, clock.now());
    BOOST_TEST(out ==
               R"({"peers":[{"node":"car1","endpoints":["tcp://0.0.0.0:1"],"epoch":"0a0b0c0d","seq":3,"age_ms":4,)"
               R"("interval_ms":1000,"state":"live","load":{"queued":0,"running":0,"workers":0},"tasks":"00"}]})");
}

BOOST_AUTO_TEST_CASE(description_has_name_and_endpoints) {
    peer_report r;
    BOOST_TEST(read_description(
        R"({"node":"car1","version":"9","protocol":1,"epoch":"0000000a","uptime_ms":5,"endpoints":["tcp://0.0.0.0:1"],"tasks":[{"verb":"pull"}]})",
        1s, r));
    BOOST_TEST(r.announced.node == "car1");
    BOOST_TEST(r.epoch == 10U);
    BOOST_TEST(r.announced.endpoints.front() == "tcp://0.0.0.0:1");
    BOOST_TEST(!read_description(R"({"node":"car1"})", 1s, r));
    BOOST_TEST(!read_description(R"({"error":"denied","message":"no"})", 1s, r));
}

BOOST_AUTO_TEST_SUITE_END()
