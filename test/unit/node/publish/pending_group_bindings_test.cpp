// SPDX-License-Identifier: BSL-1.0
// Bindings in the group that are pending until their handler decides.
#include <cles/error.hpp>

#include "node/publish/multicast_group.hpp"
#include "support/group_recorder.hpp"
#include "support/hear.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace pending_group_bindings {
namespace {

using cles::verb;
using cles::core::group_source;

constexpr group_source self{.address = 0x7f000001, .port = 4000};
constexpr group_source other{.address = 0x7f000001, .port = 4001};

struct fixture {
    fixture() { node.on_later(verb::bind, "pose"); }
    void hear(std::string_view datagram, const group_source& from = other) {
        cles::test::hear(session, from, datagram);
    }
    [[nodiscard]] auto leases() const { return node.counts().group_leases; }

    cles::test::test_node node;
    cles::test::group_recorder out{self};
    cles::core::multicast_group group{node.host, 1};
    cles::core::group_session session{node.host, group, out.share(), 1};
};

} // namespace
} // namespace pending_group_bindings

BOOST_FIXTURE_TEST_SUITE(pending_group_bindings, fixture)

BOOST_AUTO_TEST_CASE(a_source_is_bound_when_the_handler_accepts) {
    hear("BIND all:pose");
    BOOST_TEST(leases() == 0U);
    node.started.at(0)->call->done("");
    BOOST_TEST(leases() == 1U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(a_source_that_is_refused_is_not_bound) {
    hear("BIND all:pose");
    node.started.at(0)->call->fail({.code = cles::errc::denied, .message = "not you"});
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(a_repeated_bind_asks_the_handler_once_and_another_one_asks_again) {
    hear("BIND all:pose");
    hear("BIND car1:pose");
    BOOST_TEST(node.started.size() == 1U);
    hear("BIND all:pose", {.address = 0x7f000001, .port = 4002});
    hear("BIND all:pose/fast");
    BOOST_TEST(node.started.size() == 3U);
}

BOOST_AUTO_TEST_CASE(a_source_that_unbinds_meanwhile_is_not_bound) {
    hear("BIND all:pose");
    hear("BIND all:pose lease=0");
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(nothing_is_bound_after_clear) {
    hear("BIND all:pose");
    session.stop();
    BOOST_TEST(node.started.at(0)->stopped);
    node.started[0]->call->done("");
    BOOST_TEST(leases() == 0U);
}

BOOST_AUTO_TEST_CASE(the_number_of_pending_bindings_is_limited) {
    for (std::uint16_t i = 0; i < 300; ++i) {
        hear("BIND all:pose", {.address = 0x7f000001, .port = static_cast<std::uint16_t>(5000 + i)});
    }
    BOOST_TEST(node.started.size() == cles::core::group_session::max_pending);
    BOOST_TEST(node.counts().group_dropped == 300U - cles::core::group_session::max_pending);
}

BOOST_AUTO_TEST_SUITE_END()
