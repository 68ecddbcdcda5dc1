// SPDX-License-Identifier: BSL-1.0
// Bindings whose handler takes its time, by the group.
#include <cles/error.hpp>

#include "core/group_session.hpp"
#include "support/group_recorder.hpp"
#include "support/hear.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace group_welcomes {
namespace {

using cles::verb;
using cles::core::group_source;

constexpr group_source self{.address = 0x7f000001, .port = 4000};
constexpr group_source other{.address = 0x7f000001, .port = 4001};

struct fixture {
    fixture() { node.on_later(verb::bind, "pose"); }
    void hear(std::string_view datagram, const group_source& from = other) {
        cles::test::hear(session, from, datagram, node.clock.now());
    }
    [[nodiscard]] auto leases() const { return node.counts().group_leases; }

    cles::test::test_node node;
    cles::test::group_recorder out;
    cles::core::group_intake intake{*node.host, out, 1};
    cles::core::group_session session{node.host, intake, self, out, 1};
};

} // namespace
} // namespace group_welcomes

BOOST_FIXTURE_TEST_SUITE(group_welcomes, fixture)

BOOST_AUTO_TEST_CASE(who_asks_is_bound_when_the_handler_says_so) {
    hear("BIND all:pose");
    BOOST_TEST(leases() == 0U);
    node.started.at(0)->call->done("");
    BOOST_TEST(leases() == 1U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(who_is_not_welcome_is_not) {
    hear("BIND all:pose");
    node.started.at(0)->call->fail({.code = cles::errc::denied, .message = "not you"});
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(asked_again_meanwhile_it_is_one_question_and_of_another_another) {
    hear("BIND all:pose");
    hear("BIND car1:pose");
    BOOST_TEST(node.started.size() == 1U);
    hear("BIND all:pose", {.address = 0x7f000001, .port = 4002});
    hear("BIND all:pose/fast");
    BOOST_TEST(node.started.size() == 3U);
}

BOOST_AUTO_TEST_CASE(who_has_unbound_meanwhile_is_not_bound) {
    hear("BIND all:pose");
    hear("BIND all:pose lease=0");
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(after_the_end_nobody_is_bound) {
    hear("BIND all:pose");
    session.unbind_all();
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(no_more_than_so_many_wait) {
    for (std::uint16_t i = 0; i < 300; ++i) {
        hear("BIND all:pose", {.address = 0x7f000001, .port = static_cast<std::uint16_t>(5000 + i)});
    }
    BOOST_TEST(node.started.size() == cles::core::group_welcomes::most);
    BOOST_TEST(node.counts().group_dropped == 300U - cles::core::group_welcomes::most);
}

BOOST_AUTO_TEST_SUITE_END()
