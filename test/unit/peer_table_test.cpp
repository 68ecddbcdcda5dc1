// SPDX-License-Identifier: BSL-1.0
#include "core/peer_table.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <vector>

namespace peer_table {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;
using cles::core::group_source;
using cles::core::peer_beat;
using cles::core::peer_report;

constexpr group_source here{0x0A000007, 40000};

struct fixture : cles::core::table_reader {
    void on_report(const peer_report& r) override { reports.push_back(r); }
    void on_beat(const peer_beat& b) override { beats.push_back(b); }
    void on_bad_entry() override { ++bad; }

    static announcement saying(std::string node, std::string endpoint = "tcp://0.0.0.0:1") {
        return {.node = std::move(node), .endpoints = {std::move(endpoint)}, .tasks = "00"};
    }
    void hear(const std::string& node, std::uint32_t epoch, std::uint64_t seq) {
        table.hear(saying(node), epoch, seq, here, clock.now());
    }
    std::string news(const std::string& since, std::size_t longest = 1U << 20U, std::string_view describe = {}) {
        std::string out;
        cles::json_writer w{out};
        write_news(w, {"me", "0000aaaa"}, table, {since, describe}, longest, clock.now());
        return out;
    }
    /// Reads an answer, and returns what to ask with next.
    std::string read(const std::string& json) {
        reports.clear();
        beats.clear();
        bad = 0;
        good = read_table(json, 100, *this, head);
        return head.next;
    }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::presence table{"me", 0xAAAA, deadlines, 100};
    std::vector<peer_report> reports;
    std::vector<peer_beat> beats;
    int bad = 0;
    bool good = false;
    cles::core::table_head head;
};

} // namespace
} // namespace peer_table

BOOST_FIXTURE_TEST_SUITE(peer_table, fixture)

BOOST_AUTO_TEST_CASE(everything_is_told_first_then_what_has_changed) {
    auto said = saying("car1");
    said.load = {.queued = 1, .running = 2, .workers = 3};
    table.hear(said, 0x5F3A09C1, 17, here, clock.now());
    clock.advance(240ms);
    BOOST_TEST(news("0") ==
               R"({"node":"me","epoch":"0000aaaa","peers":[{"node":"car1","endpoints":["tcp://10.0.0.7:1"],)"
               R"("epoch":"5f3a09c1","seq":17,"age_ms":240,"interval_ms":1000,"state":"live",)"
               R"("load":{"queued":1,"running":2,"workers":3},"tasks":"00"}],"beats":{},"next":"0000aaaa.2"})");
    said.load.running = 5;
    table.hear(said, 0x5F3A09C1, 18, here, clock.now());
    clock.advance(90ms);
    BOOST_TEST(news("0000aaaa.2") ==
               R"({"node":"me","epoch":"0000aaaa","peers":[],"beats":{"5f3a09c1":[18,90,1000,1,5]},)"
               R"("next":"0000aaaa.3"})");
    BOOST_TEST(news("0000aaaa.3") == R"({"node":"me","epoch":"0000aaaa","peers":[],"beats":{},"next":"0000aaaa.3"})");
}

BOOST_AUTO_TEST_CASE(a_value_of_since_that_is_not_known_counts_as_none) {
    hear("car1", 1, 1);
    for (const auto* since : {"0", "1", "0000bbbb.2", "0000aaaa.999", "0000aaaa.", "0000aaaa.x", "0000aaaa", "-"}) {
        read(news(since));
        BOOST_TEST(reports.size() == 1U, since);
    }
}

BOOST_AUTO_TEST_CASE(more_than_workers_load_is_a_description_again) {
    hear("car1", 1, 1);
    const auto since = read(news("0"));
    auto said = saying("car1");
    said.load.workers = 8;
    table.hear(said, 1, 2, here, clock.now());
    read(news(since));
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].said.load.workers == 8U);
    BOOST_TEST(beats.empty());
}

BOOST_AUTO_TEST_CASE(that_work_takes_much_longer_is_a_description_again) {
    auto said = saying("car1");
    std::uint64_t seq = 0;
    const auto is_described = [&](std::uint32_t service_us) {
        const auto since = read(news("0"));
        said.load.service_us = service_us;
        table.hear(said, 1, ++seq, here, clock.now());
        read(news(since));
        BOOST_TEST(reports.size() + beats.size() == 1U);
        return !reports.empty();
    };
    is_described(1'000);               // it appears
    BOOST_TEST(!is_described(49'999)); // of what is quick nothing depends on how quick
    BOOST_TEST(is_described(150'000));
    BOOST_TEST(!is_described(400'000));
    BOOST_TEST(is_described(800'000));
    BOOST_TEST(is_described(2'000));
    BOOST_TEST(is_described(50'000));
    // So does this node of itself.
    const auto speaks = [&](std::uint32_t service_us) {
        const auto since = read(news("0"));
        table.speak({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}, .load = {.service_us = service_us}}, ++seq,
                    clock.now());
        read(news(since));
        return reports.size() == 1U;
    };
    speaks(1'000);
    BOOST_TEST(!speaks(2'000));
    BOOST_TEST(speaks(200'000));
    BOOST_TEST(!speaks(300'000));
    BOOST_TEST(speaks(1'000));
}

BOOST_AUTO_TEST_CASE(the_node_that_answers_is_told_of_where_it_announces_itself) {
    table.speak({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}}, 1, clock.now());
    read(news("0"));
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].said.node == "me");
    BOOST_TEST(reports[0].said.endpoints.front() == "tcp://0.0.0.0:9");
    BOOST_TEST(head.node == "me");
    BOOST_TEST(head.epoch == "0000aaaa");
}

BOOST_AUTO_TEST_CASE(runs_are_described_again_to_who_asks_for_it) {
    hear("car1", 1, 1);
    hear("car2", 2, 1);
    hear("car3", 3, 1);
    const auto since = read(news("0"));
    hear("car2", 2, 2);
    const auto next = read(news(since, 1U << 20U, "00000001,00000002,00000009"));
    BOOST_REQUIRE(reports.size() == 2U);
    BOOST_TEST(reports[0].said.node == "car1");
    BOOST_TEST(reports[1].said.node == "car2");
    BOOST_TEST(beats.empty());
    read(news(next));
    BOOST_TEST(reports.empty());
}

BOOST_AUTO_TEST_CASE(what_has_left_is_told_as_such) {
    hear("car1", 1, 1);
    const auto since = read(news("0"));
    table.hear({.node = "car1", .leaving = true}, 1, 2, here, clock.now());
    clock.advance(5ms);
    const auto told = news(since);
    BOOST_TEST(told.find(R"("peers":[{"node":"car1","epoch":"00000001","seq":2,"age_ms":5,"state":"left"}])") !=
               std::string::npos);
    read(told);
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].said.leaving);
    clock.advance(15s);
    read(news(since)); // nobody believes its last words any more
    BOOST_TEST(reports.empty());
}

BOOST_AUTO_TEST_CASE(who_has_said_farewell_tells_of_himself_as_one_that_has_left) {
    table.leave(clock.now()); // nobody has heard of it
    BOOST_TEST(news("0").find("\"peers\":[]") != std::string::npos);
    table.speak({.node = "me", .endpoints = {"tcp://0.0.0.0:9"}}, 1, clock.now());
    const auto since = read(news("0"));
    table.leave(clock.now());
    for (const auto& told : {news("0"), news(since)}) {
        BOOST_TEST(told.find(R"("peers":[{"node":"me","epoch":"0000aaaa","seq":2,"age_ms":0,"state":"left"}])") !=
                   std::string::npos);
    }
    const auto next = read(news(since));
    table.leave(clock.now());
    BOOST_TEST(news(next).find("\"peers\":[]") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(two_runs_of_one_epoch_are_always_told_in_full) {
    hear("car1", 7, 1);
    hear("car2", 7, 1);
    const auto since = read(news("0"));
    hear("car1", 7, 2);
    read(news(since));
    BOOST_TEST(beats.empty());
    BOOST_TEST(reports.size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_does_not_go_into_one_answer_comes_with_the_next) {
    for (std::uint32_t i = 1; i <= 50; ++i) {
        hear("car" + std::to_string(i), i, 1);
    }
    std::string since = "0";
    std::size_t got = 0;
    std::size_t answers = 0;
    do {
        const auto told = news(since, 1200);
        BOOST_TEST(told.size() <= 1200U);
        since = read(told);
        BOOST_TEST(!reports.empty());
        got += reports.size();
        ++answers;
        BOOST_REQUIRE(answers < 50U);
    } while (head.more);
    BOOST_TEST(got == 50U);
    BOOST_TEST(answers > 5U);
}

BOOST_AUTO_TEST_CASE(one_for_which_there_is_no_room_goes_without_some_endpoints) {
    announcement said{.node = "car1"};
    said.endpoints.assign(16, "unix://@" + std::string(100, 'a'));
    table.hear(said, 1, 1, {0x7F000001, 1}, clock.now());
    const auto told = news("0", 1200);
    BOOST_TEST(told.size() <= 1200U);
    read(told);
    BOOST_REQUIRE(reports.size() == 1U);
    BOOST_TEST(reports[0].said.endpoints.size() < 16U);
    BOOST_TEST(!reports[0].said.endpoints.empty());
    BOOST_TEST(!head.more);
}

BOOST_AUTO_TEST_CASE(an_entry_is_read_whatever_the_order_and_what_is_unknown_passed_over) {
    read(R"({"x":{"y":[1]},"peers":[{"z":1,"load":{"running":2,"queued":1},"state":"suspect","age_ms":7,)"
         R"("epoch":"0000000a","endpoints":["tcp://1.2.3.4:5"],"node":"car1"}]})");
    BOOST_TEST(good);
    BOOST_REQUIRE(reports.size() == 1U);
    const auto& r = reports[0];
    BOOST_TEST(r.said.node == "car1");
    BOOST_TEST(r.epoch == 10U);
    BOOST_TEST(r.seq == 0U);
    BOOST_TEST((r.age == 7ms));
    BOOST_TEST(!r.has_interval);
    BOOST_TEST(r.said.load.running == 2U);
    BOOST_TEST(head.next.empty()); // a plain table
}

BOOST_AUTO_TEST_CASE(an_entry_with_a_mistake_is_passed_over_alone) {
    for (const auto* wrong :
         {R"({"node":7,"epoch":"00000001"})", R"({"node":"car2"})", R"({"node":"car2","epoch":"1"})",
          R"({"node":"car 2","epoch":"00000001"})", R"({"node":"all","epoch":"00000001"})", R"({"epoch":"00000001"})",
          R"({"node":"car2","epoch":"00000001","age_ms":-1})", R"({"node":"car2","epoch":"00000001","load":[]})", "7",
          "[]"}) {
        read(R"({"peers":[)" + std::string{wrong} + R"(,{"node":"car1","epoch":"00000001"}]})");
        BOOST_TEST(good, wrong);
        BOOST_TEST(bad == 1, wrong);
        BOOST_TEST(reports.size() == 1U, wrong);
    }
}

BOOST_AUTO_TEST_CASE(what_is_no_table_is_refused) {
    for (const auto* wrong :
         {"", "[]", "7", "{}", R"({"peers":7})", R"({"peers":[)", R"({"peers":[],"beats":[]})",
          R"({"peers":[],"beats":{"00000001":[1,2]}})", R"({"peers":[],"next":7})", R"({"peers":[],"more":1})"}) {
        read(wrong);
        BOOST_TEST(!good, wrong);
    }
}

BOOST_AUTO_TEST_CASE(beats_may_grow_and_their_keys_are_epochs) {
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

BOOST_AUTO_TEST_CASE(only_so_many_entries_count) {
    std::string text = R"({"peers":[)";
    for (int i = 0; i < 150; ++i) {
        text += std::string{i == 0 ? "" : ","} + R"({"node":"car1","epoch":"00000001"})";
    }
    read(text + "]}");
    BOOST_TEST(good);
    BOOST_TEST(reports.size() == 100U);
}

BOOST_AUTO_TEST_CASE(a_node_tells_of_itself) {
    std::string out;
    cles::json_writer w{out};
    write_own_entry(w, saying("car1"), "0a0b0c0d", 3, 4ms);
    BOOST_TEST(out ==
               R"({"peers":[{"node":"car1","endpoints":["tcp://0.0.0.0:1"],"epoch":"0a0b0c0d","seq":3,"age_ms":4,)"
               R"("interval_ms":1000,"state":"live","load":{"queued":0,"running":0,"workers":0},"tasks":"00"}]})");
}

BOOST_AUTO_TEST_CASE(a_description_says_who_answers_and_where_he_listens) {
    peer_report r;
    BOOST_TEST(read_description(
        R"({"node":"car1","version":"9","protocol":1,"epoch":"0000000a","uptime_ms":5,"endpoints":["tcp://0.0.0.0:1"],"tasks":[{"verb":"pull"}]})",
        r));
    BOOST_TEST(r.said.node == "car1");
    BOOST_TEST(r.epoch == 10U);
    BOOST_TEST(r.said.endpoints.front() == "tcp://0.0.0.0:1");
    BOOST_TEST(!read_description(R"({"node":"car1"})", r));
    BOOST_TEST(!read_description(R"({"error":"denied","message":"no"})", r));
}

BOOST_AUTO_TEST_SUITE_END()
