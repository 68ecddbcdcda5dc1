// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_log.hpp"

#include <boost/test/unit_test.hpp>

using cles::log_entry;
using cles::runtime::format_json;
using cles::runtime::format_text;

BOOST_AUTO_TEST_SUITE(log_format)

BOOST_AUTO_TEST_CASE(text_names_node_peer_and_request) {
    BOOST_TEST(format_text("sat1", "up") == "sat1: up");
    BOOST_TEST(format_text("sat1", {"denied", "tcp://127.0.0.1:4242"}) == "sat1 tcp://127.0.0.1:4242: denied");
    BOOST_TEST(format_text("sat1", {"denied", "tcp://127.0.0.1:4242", 7}) == "sat1 tcp://127.0.0.1:4242 id=7: denied");
}

BOOST_AUTO_TEST_CASE(json_omits_missing_members) {
    BOOST_TEST(format_json("sat1", "up") == R"("node":"sat1","message":"up")");
    BOOST_TEST(format_json("sat1", {"denied", "tcp://127.0.0.1:4242", 7}) ==
               R"("node":"sat1","peer":"tcp://127.0.0.1:4242","id":7,"message":"denied")");
    BOOST_TEST(format_json("sat1", {"half way", "", 0, "4bf92f3577b34da6a3ce929d0e0e4736"}) ==
               R"("node":"sat1","trace":"4bf92f3577b34da6a3ce929d0e0e4736","message":"half way")");
}

BOOST_AUTO_TEST_CASE(control_characters_are_escaped) {
    BOOST_TEST(format_text("sat1", "a\nb\tc\x1b[31md\x7f") == "sat1: a\\nb\\tc\\u001b[31md\\u007f");
    BOOST_TEST(format_text("sat1", "gr\xc3\xbc\xc3\x9f") == "sat1: gr\xc3\xbc\xc3\x9f");
    BOOST_TEST(format_json("sat1", "a\n\"b\"") == R"("node":"sat1","message":"a\n\"b\"")");
    const std::string foreign = "\xc2\x9b"
                                "2J\xc2\x9d\xe2\x80\xae\xe2\x81\xa6\xd8\x9c\xe2\x80\x8e";
    const std::string shown = R"(\u009b2J\u009d\u202e\u2066\u061c\u200e)";
    BOOST_TEST(format_text("sat1", {foreign, foreign}) == "sat1 " + shown + ": " + shown);
    BOOST_TEST(format_json("sat1", {foreign, foreign}) ==
               R"("node":"sat1","peer":")" + shown + R"(","message":")" + shown + "\"");
}

BOOST_AUTO_TEST_SUITE_END()
