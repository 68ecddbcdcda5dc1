// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcement.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>

namespace announcement {
namespace {

using namespace std::chrono_literals;
using statement = cles::core::announcement;

struct reading {
    bool good = false;
    statement said;
    std::string why;
};

reading read(std::string_view line) {
    cles::protocol::request_line update;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_request(line, update, wrong), wrong.why);
    reading r;
    r.good = read_announcement(update, r.said, r.why);
    return r;
}

reading read_body(std::string_view body) { return read("UPDATE car1:cles seq=1 epoch=5f3a09c1 " + std::string{body}); }

std::string written(const statement& said, std::uint64_t seq = 17) {
    std::string out;
    append_announcement(out, said, seq, "5f3a09c1");
    return out;
}

} // namespace
} // namespace announcement

BOOST_AUTO_TEST_SUITE(announcement)

BOOST_AUTO_TEST_CASE(format_matches_the_protocol) {
    const statement said{.node = "car1",
                         .endpoints = {"tcp://0.0.0.0:25370", "udp://10.0.0.7:25370"},
                         .load = {.queued = 3, .running = 2, .workers = 4},
                         .interval = 1500ms,
                         .tasks = "cbf29ce484222325"};
    BOOST_TEST(written(said) ==
               "UPDATE car1:cles seq=17 epoch=5f3a09c1 {\"node\":\"car1\",\"endpoints\":[\"tcp://0.0.0.0:25370\","
               "\"udp://10.0.0.7:25370\"],\"load\":{\"queued\":3,\"running\":2,\"workers\":4},\"interval_ms\":1500,"
               "\"tasks\":\"cbf29ce484222325\"}\n");
}

BOOST_AUTO_TEST_CASE(lists_signed_tasks) {
    const statement said{.node = "car1", .signed_tasks = {"control", "strike"}};
    const auto line = written(said);
    BOOST_TEST(line.ends_with(",\"signed\":[\"control\",\"strike\"]}\n"));
    const auto r = read(std::string_view{line}.substr(0, line.size() - 1));
    BOOST_REQUIRE_MESSAGE(r.good, r.why);
    BOOST_TEST(r.said.signed_tasks == said.signed_tasks, boost::test_tools::per_element());
    BOOST_TEST(written({.node = "car1"}).find("signed") == std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_list_of_signed_tasks_is_read_as_a_whole_or_refused) {
    BOOST_TEST(!read_body(R"({"node":"car1","signed":"control"})").good);
    BOOST_TEST(!read_body(R"({"node":"car1","signed":[1]})").good);
    std::string many = "\"a\"";
    for (int i = 0; i < 600; ++i) {
        many += ",\"a\"";
    }
    BOOST_TEST(!read_body(R"({"node":"car1","signed":[)" + many + "]}").good);
}

BOOST_AUTO_TEST_CASE(lists_its_sources_with_several_interfaces) {
    const statement said{
        .node = "car1", .endpoints = {"tcp://0.0.0.0:1"}, .sources = {{0x7F000001, 7}, {0x0A000007, 8}}};
    const auto line = written(said);
    BOOST_TEST(line.find("[\"tcp://0.0.0.0:1\"],\"sources\":[\"127.0.0.1:7\",\"10.0.0.7:8\"],\"load\"") !=
               std::string::npos);
    const auto r = read(std::string_view{line}.substr(0, line.size() - 1));
    BOOST_REQUIRE_MESSAGE(r.good, r.why);
    BOOST_TEST((r.said.sources == said.sources));
}

BOOST_AUTO_TEST_CASE(skips_unreadable_and_excess_sources) {
    const auto r = read_body(R"({"sources":["x","10.0.0.7","10.0.0.7:0","[::1]:5","10.0.0.8:2"]})");
    BOOST_REQUIRE_MESSAGE(r.good, r.why);
    BOOST_REQUIRE(r.said.sources.size() == 1U);
    BOOST_TEST(to_text(r.said.sources[0]) == "10.0.0.8:2");
    std::string many;
    for (int i = 1; i < 20; ++i) {
        many += (many.empty() ? "\"10.0.0.1:" : ",\"10.0.0.1:") + std::to_string(i) + "\"";
    }
    BOOST_TEST(read_body("{\"sources\":[" + many + "]}").said.sources.size() == 8U);
    BOOST_TEST(!read_body(R"({"sources":"10.0.0.8:2"})").good);
    BOOST_TEST(!read_body(R"({"sources":[7]})").good);
}

BOOST_AUTO_TEST_CASE(leave_is_marked) {
    const statement said{.node = "car1", .leaving = true};
    BOOST_TEST(written(said).ends_with(",\"tasks\":\"\",\"leaving\":true}\n"));
}

BOOST_AUTO_TEST_CASE(reads_what_was_written) {
    statement said{.node = "car1",
                   .endpoints = {"tcp://0.0.0.0:25370", "unix:///run/car1.sock"},
                   .load = {.queued = 3, .running = 2, .workers = 4},
                   .interval = 1500ms,
                   .tasks = "cbf29ce484222325",
                   .leaving = true};
    auto line = written(said);
    line.pop_back();
    const auto r = read(line);
    BOOST_TEST(r.good);
    BOOST_TEST(r.said.node == "car1");
    BOOST_TEST(r.said.endpoints == said.endpoints, boost::test_tools::per_element());
    BOOST_TEST((r.said.load == said.load));
    BOOST_TEST((r.said.interval == 1500ms));
    BOOST_TEST(r.said.tasks == "cbf29ce484222325");
    BOOST_TEST(r.said.leaving);
}

BOOST_AUTO_TEST_CASE(always_fits_a_datagram) {
    statement said{.node = std::string(64, 'n'), .tasks = std::string(16, 'f')};
    for (int i = 0; i < 40; ++i) {
        said.endpoints.push_back("unix:///" + std::string(90, 'a') + std::to_string(i));
    }
    auto line = written(said, 9'223'372'036'854'775'807U);
    BOOST_TEST(line.size() <= cles::protocol::datagram_bytes);
    BOOST_TEST(line.size() > cles::protocol::datagram_bytes - 120);
    line.pop_back();
    const auto r = read(line);
    BOOST_TEST(r.good);
    BOOST_REQUIRE(!r.said.endpoints.empty());
    BOOST_TEST(r.said.endpoints.front() == said.endpoints.front()); // the last are omitted
}

BOOST_AUTO_TEST_CASE(skips_unknown_keys) {
    const auto r = read_body(R"({"colour":"red","load":{"queued":1,"mood":[{}]},"node":"car1","gossip":{"a":[1]}})");
    BOOST_TEST(r.good);
    BOOST_TEST(r.said.load.queued == 1U);
}

BOOST_AUTO_TEST_CASE(missing_keys_have_defaults) {
    const auto r = read_body("{}");
    BOOST_TEST(r.good);
    BOOST_TEST(r.said.node == "car1");
    BOOST_TEST(r.said.endpoints.empty());
    BOOST_TEST((r.said.interval == 1s));
    BOOST_TEST((r.said.load == cles::node_load{}));
    BOOST_TEST(!r.said.leaving);
}

BOOST_AUTO_TEST_CASE(error_names_the_key_with_a_wrong_type) {
    const std::pair<const char*, const char*> wrong[] = {
        {R"({"node":1})", "node"},
        {R"({"endpoints":"tcp://10.0.0.1:1"})", "endpoints"},
        {R"({"endpoints":[1]})", "endpoints"},
        {R"({"load":[]})", "load"},
        {R"({"load":{"queued":-1}})", "load"},
        {R"({"load":{"running":1.5}})", "load"},
        {R"({"interval_ms":"1000"})", "interval_ms"},
        {R"({"interval_ms":-1})", "interval_ms"},
        {R"({"tasks":7})", "tasks"},
        {R"({"leaving":"yes"})", "leaving"},
        {R"([])", "object"},
        {R"({"node":"car1"} {})", ""},
        {R"({"node":"car1")", ""},
        {R"({"x":[[[[[[[[1]]]]]]]]})", "deep"},
    };
    for (const auto& [body, says] : wrong) {
        const auto r = read_body(body);
        BOOST_TEST(!r.good, body);
        BOOST_TEST(r.why.find(says) != std::string::npos, r.why);
    }
}

BOOST_AUTO_TEST_CASE(node_can_announce_only_itself) {
    BOOST_TEST(!read_body(R"({"node":"car2"})").good);
    for (const auto* noun : {"self:cles", "any:cles", "all:cles", "car1:cles/x", "car1:speed"}) {
        BOOST_TEST(!read("UPDATE " + std::string{noun} + " seq=1 epoch=5f3a09c1 {}").good, noun);
    }
    BOOST_TEST(!read("UPDATE car1:cles {}").good); // a request, not an update
    BOOST_TEST(!read("PUSH car1:cles {}").good);
}

BOOST_AUTO_TEST_CASE(endpoints_are_bounded_in_number_and_length) {
    std::string body = R"({"endpoints":[")" + std::string(129, 'x') + R"(","")";
    for (int i = 0; i < 100; ++i) {
        body += ",\"tcp://10.0.0." + std::to_string(i) + ":1\"";
    }
    const auto r = read_body(body + "]}");
    BOOST_TEST(r.good);
    BOOST_TEST(r.said.endpoints.size() == 16U);
    BOOST_TEST(r.said.endpoints.front() == "tcp://10.0.0.0:1");
}

BOOST_AUTO_TEST_CASE(interval_load_and_digest_are_bounded) {
    BOOST_TEST((read_body(R"({"interval_ms":0})").said.interval == 250ms));
    BOOST_TEST((read_body(R"({"interval_ms":18446744073709551615})").said.interval == 60s));
    BOOST_TEST(read_body(R"({"load":{"queued":18446744073709551615}})").said.load.queued == 4'294'967'295U);
    BOOST_TEST(read_body(R"({"tasks":")" + std::string(64, 'f') + "\"}").good);
    BOOST_TEST(!read_body(R"({"tasks":")" + std::string(65, 'f') + "\"}").good);
}

BOOST_AUTO_TEST_CASE(digest_of_tasks_is_distinct_and_stable) {
    using cles::core::digest_of_tasks;
    BOOST_TEST(digest_of_tasks("") == "cbf29ce484222325");
    BOOST_TEST(digest_of_tasks("a") == "af63dc4c8601ec8c"); // from the authors of FNV
    BOOST_TEST(digest_of_tasks("foobar") == "85944171f73967e8");
    BOOST_TEST(digest_of_tasks("[]") != digest_of_tasks("[{}]"));
}

BOOST_AUTO_TEST_SUITE_END()
