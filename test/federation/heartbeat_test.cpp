// SPDX-License-Identifier: BSL-1.0
#include "federation/heartbeat.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace heartbeat_suite {
namespace {

using namespace cles::bridging; // NOLINT(google-build-using-namespace)
using std::chrono::milliseconds;

const std::string digest = "0123456789abcdef";

} // namespace
} // namespace heartbeat_suite

CLES_TEST_SUITE(heartbeat)

BOOST_AUTO_TEST_CASE(it_is_read_as_written) {
    const cles::bridging::heartbeat plain{.node = "hub", .interval = milliseconds{400}, .names = digest};
    BOOST_TEST(text_of(plain) == R"({"node":"hub","interval_ms":400,"names":"0123456789abcdef"})");
    BOOST_TEST((parse_heartbeat(text_of(plain)) == plain));
    const cles::bridging::heartbeat full{.node = "hub",
                                         .interval = milliseconds{1'000},
                                         .names = digest,
                                         .replaces = digest,
                                         .leaving = true,
                                         .starting = true,
                                         .closing = true,
                                         .roster = 7,
                                         .sessions = true};
    BOOST_TEST((parse_heartbeat(text_of(full)) == full));
}

BOOST_AUTO_TEST_CASE(what_is_not_known_is_ignored) {
    const auto read = parse_heartbeat(R"({"future":[1,{}],"node":"hub","names":"0123456789abcdef","interval_ms":1})");
    BOOST_REQUIRE(read.has_value());
    BOOST_TEST(read->interval.count() == 100);
}

BOOST_AUTO_TEST_CASE(an_optional_member_that_is_null_is_absent) {
    const auto read = parse_heartbeat(R"({"node":"hub","interval_ms":null,"names":"0123456789abcdef","replaces":null,)"
                                      R"("leaving":null,"starting":null,"closing":null,"roster":null})");
    BOOST_REQUIRE(read.has_value());
    BOOST_TEST((*read == cles::bridging::heartbeat{.node = "hub", .interval = milliseconds{100}, .names = digest}));
    BOOST_TEST(!parse_heartbeat(R"({"node":null,"names":"0123456789abcdef"})").has_value());
    BOOST_TEST(!parse_heartbeat(R"({"node":"hub","names":null})").has_value());
}

BOOST_AUTO_TEST_CASE(anything_else_is_refused) {
    for (const std::string_view text :
         {"", "{}", "[]", "hello", R"({"node":"hub"})", R"({"node":"h b","names":"0123456789abcdef"})",
          R"({"node":"hub","names":"12"})", R"({"node":"hub","names":"0123456789abcdef","leaving":1})",
          R"({"node":"hub","names":"0123456789abcdef","replaces":"x"})",
          R"({"node":"hub","names":"0123456789abcdef"} x)", R"({"node":"hub","names":"0123456789abcdef")"}) {
        BOOST_TEST(!parse_heartbeat(text).has_value(), text);
    }
}

BOOST_AUTO_TEST_CASE(names_are_sorted_and_have_a_digest) {
    const auto names = names_of({"car2", "car1", "car2"});
    BOOST_TEST((names.nodes == std::vector<std::string>{"car1", "car2"}));
    BOOST_TEST(names.digest == names_of({"car1", "car2"}).digest);
    BOOST_TEST(names.digest != names_of({"car1car2"}).digest);
    BOOST_TEST((parse_names(text_of(names), 10) == names));
    BOOST_TEST(parse_names(text_of(names), 1)->nodes.size() == 1U);
    BOOST_TEST((parse_names(text_of(names_of({})), 10) == names_of({})));
}

BOOST_AUTO_TEST_CASE(names_without_nodes_are_none) {
    const auto read = parse_names(R"({"digest":"0123456789abcdef"})", 10);
    BOOST_REQUIRE(read.has_value());
    BOOST_TEST(read->digest == digest);
    BOOST_TEST(read->nodes.empty());
}

BOOST_AUTO_TEST_CASE(what_is_no_list_of_names_is_refused) {
    for (const std::string_view text : {"", "{}", R"({"digest":"0123456789abcdef","nodes":"car1"})",
                                        R"({"digest":"0123456789abcdef","nodes":["a b"]})",
                                        R"({"digest":"0123456789abcdef","nodes":["a"})", R"({"nodes":["a"]})"}) {
        BOOST_TEST(!parse_names(text, 10).has_value(), text);
    }
}

BOOST_AUTO_TEST_SUITE_END()
