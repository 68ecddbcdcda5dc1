// SPDX-License-Identifier: BSL-1.0
#include "federation/subject.hpp"
#include "support/test_suite.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace subject_suite {
namespace {

using namespace cles::bridging; // NOLINT(google-build-using-namespace)
using cles::verb;

const bridge_id gate{"north", "0123456789abcdef"};

} // namespace
} // namespace subject_suite

CLES_TEST_SUITE(subject)

BOOST_AUTO_TEST_CASE(a_request_names_pool_verb_node_and_task) {
    BOOST_TEST(request_subject("north", verb::pull, "car1", "speed") == "cles.north.pull.car1.speed");
    const auto read = parse_subject("cles.north.delegate.car1.plan");
    BOOST_TEST((read.kind == subject_kind::request));
    BOOST_TEST(read.pool == "north");
    BOOST_TEST((read.verb == verb::delegate));
    BOOST_TEST(read.node == "car1");
    BOOST_TEST(read.task == "plan");
}

BOOST_AUTO_TEST_CASE(dots_in_names_are_escaped) {
    const auto text = request_subject("north", verb::push, "car.1", "a.b.c");
    BOOST_TEST(text == "cles.north.push.car%2E1.a%2Eb%2Ec");
    const auto read = parse_subject(text);
    BOOST_TEST(read.node == "car.1");
    BOOST_TEST(read.task == "a.b.c");
}

BOOST_AUTO_TEST_CASE(messages_for_a_bridge_are_requests_replies_or_control) {
    const auto request = parse_subject(request_subject(gate));
    BOOST_TEST((request.kind == subject_kind::request));
    BOOST_TEST((request.bridge() == gate));
    BOOST_TEST(parse_subject("cles.north.pull.car1.speed").instance.empty());
    const auto reply = parse_subject(reply_subject(gate, 7));
    BOOST_TEST((reply.kind == subject_kind::reply));
    BOOST_TEST(reply.number == 7U);
    BOOST_TEST((reply.bridge() == gate));
    BOOST_TEST(inbox_filter(gate) == "cles.north.bridge.0123456789abcdef.*");
    const auto control = parse_subject(control_subject(gate));
    BOOST_TEST((control.kind == subject_kind::control));
    BOOST_TEST((control.bridge() == gate));
}

BOOST_AUTO_TEST_CASE(bridges_speak_of_themselves) {
    BOOST_TEST((parse_subject(heartbeat_subject(gate)).kind == subject_kind::heartbeat));
    BOOST_TEST((parse_subject(names_subject(gate)).kind == subject_kind::names));
    BOOST_TEST((parse_subject(feed_subject("north", "car1", "speed")).kind == subject_kind::feed));
}

BOOST_AUTO_TEST_CASE(everything_else_is_foreign) {
    for (const std::string_view text : {"",
                                        "cles",
                                        "cles.north",
                                        "cles.north.pull",
                                        "cles.north.pull.car1",
                                        "cles.north.pull.car1.speed.more",
                                        "cles.north.fetch.car1.speed",
                                        "other.north.pull.car1.speed",
                                        "cles..pull.car1.speed",
                                        "cles.any.pull.car1.speed",
                                        "cles.no%2Erth.pull.car1.speed",
                                        "cles.north.pull.car%2e1.speed",
                                        "cles.north.pull.car%.speed",
                                        "cles.north.pull..speed",
                                        "cles.north.pull.c r.speed",
                                        "cles.north.beat.0123456789ABCDEF",
                                        "cles.north.beat.12",
                                        "cles.north.bridge.0123456789abcdef.0",
                                        "cles.north.bridge.0123456789abcdef.x",
                                        "cles.north.bridge.12.control",
                                        "_INBOX.abc.def"}) {
        BOOST_TEST((parse_subject(text).kind == subject_kind::foreign), text);
    }
}

BOOST_AUTO_TEST_CASE(the_name_of_a_pool_is_one_word) {
    BOOST_TEST(is_pool_name("north-2_b"));
    BOOST_TEST(is_pool_name(std::string(max_pool_name, 'p')));
    for (const std::string& text : {std::string{}, std::string{"a.b"}, std::string{"all"}, std::string{"a b"},
                                    std::string(max_pool_name + 1, 'p')}) {
        BOOST_TEST(!is_pool_name(text), text);
    }
}

BOOST_AUTO_TEST_CASE(an_instance_has_16_digits) {
    BOOST_TEST(instance_text(0) == "0000000000000000");
    BOOST_TEST(instance_text(0x0123456789abcdefU) == "0123456789abcdef");
    BOOST_TEST(is_instance(instance_text(~std::uint64_t{0})));
}

BOOST_AUTO_TEST_SUITE_END()
