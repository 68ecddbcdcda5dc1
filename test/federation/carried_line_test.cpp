// SPDX-License-Identifier: BSL-1.0
#include "federation/carried_line.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace carried_line_suite {
namespace {

using namespace cles::bridging; // NOLINT(google-build-using-namespace)
using cles::verb;

cles::protocol::request_line parsed(std::string_view line) {
    cles::protocol::request_line r;
    cles::protocol::malformed_request wrong;
    BOOST_REQUIRE(cles::protocol::parse_request(line, r, wrong));
    return r;
}

} // namespace
} // namespace carried_line_suite

CLES_TEST_SUITE(carried_line)

BOOST_AUTO_TEST_CASE(the_message_is_the_rest_of_the_line) {
    BOOST_TEST(message_of(parsed("PULL car1:speed id=7"), "south") == "");
    BOOST_TEST(message_of(parsed("PULL car1:speed/fast/2 id=7 deadline=900 hops=7 via=hub,gate"), "south") ==
               "/fast/2 deadline=900 hops=7 via=south.hub,south.gate");
    BOOST_TEST(message_of(parsed("PUSH car1:speed x=1 id=7  {\"a\": 1}"), "south") == " x=1 {\"a\": 1}");
}

BOOST_AUTO_TEST_CASE(another_deadline_takes_the_place_of_the_requests_own) {
    BOOST_TEST(message_of(parsed("PUSH all:speed/fast id=7 x=1 deadline=900 via=hub {}"), "south", 675) ==
               "/fast deadline=675 x=1 via=south.hub {}");
    BOOST_TEST(message_within_pool(parsed("PULL all:speed id=7 via=hub"), 4000) == " deadline=4000");
}

BOOST_AUTO_TEST_CASE(what_a_bridge_passes_on_keeps_via) {
    BOOST_TEST(message_of(parsed("PULL car1:speed via=hub"), {}) == " via=hub");
}

BOOST_AUTO_TEST_CASE(within_a_pool_via_is_left_out) {
    BOOST_TEST(message_within_pool(parsed("PUSH car1:speed/fast id=7 via=hub x=1 {}")) == "/fast x=1 {}");
}

BOOST_AUTO_TEST_CASE(a_long_name_in_via_is_cut) {
    const std::string name(64, 'n');
    const auto message = message_of(parsed("PULL car1:speed via=" + name), "south");
    BOOST_TEST(message == " via=south." + std::string(58, 'n'));
    BOOST_TEST(has_passed(parsed(text_of(verb::pull, "car1", "speed", message)).via, "south"));
}

BOOST_AUTO_TEST_CASE(a_message_is_a_line_again) {
    BOOST_TEST(text_of(verb::pull, "car1", "speed", "") == "PULL car1:speed");
    BOOST_TEST(text_of(verb::pull, "car1", "speed", "/fast deadline=9") == "PULL car1:speed/fast deadline=9");
    BOOST_TEST(text_of(verb::push, "car1", "speed", "{\"a\":1}") == "PUSH car1:speed {\"a\":1}");
    BOOST_TEST(text_of(verb::update, "car1", "speed", " seq=1 epoch=00000001 {}") ==
               "UPDATE car1:speed seq=1 epoch=00000001 {}");
    // A program cannot change the noun by what it sends.
    BOOST_TEST(text_of(verb::pull, "car1", "speed", "x:y") == "PULL car1:speed x:y");
}

BOOST_AUTO_TEST_CASE(the_line_for_the_node_has_its_id_and_the_pool) {
    BOOST_TEST(line_of(parsed("DELEGATE car1:plan id=99 progress=yes deadline=5 {\"a\":1}"), 3, "south") ==
               "DELEGATE car1:plan id=3 via=south.nats progress=yes deadline=5 {\"a\":1}");
    BOOST_TEST(line_of(parsed("PULL car1:speed/fast via=south.hub x=1"), 3, "south") ==
               "PULL car1:speed/fast id=3 via=south.nats,south.hub x=1");
    BOOST_TEST(line_of(parsed("PULL car1:speed"), 3, {}) == "PULL car1:speed id=3 via=program.nats");
}

BOOST_AUTO_TEST_CASE(a_request_from_another_pool_is_recognised) {
    BOOST_TEST(has_crossed("south.nats"));
    BOOST_TEST(has_crossed("south.nats,south.hub,gate"));
    BOOST_TEST(has_crossed("south.hub,program.nats"));
    BOOST_TEST(!has_crossed("hub,nats,natsy,gate.nats1"));
    BOOST_TEST(!has_crossed(""));
}

BOOST_AUTO_TEST_CASE(pools_in_via_are_recognised) {
    BOOST_TEST(has_passed("south.hub,north.gate", "north"));
    BOOST_TEST(!has_passed("south.hub,northern.gate,north", "north"));
    BOOST_TEST(!has_passed("", "north"));
}

BOOST_AUTO_TEST_CASE(replies_lose_their_id) {
    const auto reply = split_reply("id=7 {\"value\":3}");
    BOOST_TEST(reply.id == 7U);
    BOOST_TEST(reply.rest == "{\"value\":3}");
    BOOST_TEST(!reply.is_interim);
    BOOST_TEST(split_reply("id=7 progress=0.5 {}").is_interim);
    for (const std::string_view text : {"{}", "id=7", "id=x {}", "id=0 {}", "PUSH self:cles/leaving reply=no"}) {
        BOOST_TEST(split_reply(text).id == 0U, text);
    }
}

BOOST_AUTO_TEST_SUITE_END()
