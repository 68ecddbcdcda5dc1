// SPDX-License-Identifier: BSL-1.0
#include "node/membership/peer_table.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

namespace peer_list {
namespace {

using namespace std::chrono_literals;
using cles::core::announcement;

constexpr cles::core::group_source here{0x0A000007, 40000};

struct fixture {
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::membership table{"me", 0xAAAA, deadlines, 5};
};

} // namespace
} // namespace peer_list

BOOST_FIXTURE_TEST_SUITE(peer_list, fixture)

BOOST_AUTO_TEST_CASE(format_matches_the_protocol) {
    announcement said{.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}};
    said.load = {.queued = 1, .running = 2, .workers = 3};
    table.apply_announcement(said, 0x5F3A09C1, 1, here, clock.now());
    clock.advance(250ms);
    std::string out;
    cles::json_writer w{out};
    cles::core::write_peers(w, table.list(clock.now()), {});
    BOOST_TEST(out == R"({"peers":[{"node":"car1","endpoints":["tcp://10.0.0.7:1"],"epoch":"5f3a09c1","age_ms":250,)"
                      R"("state":"live","load":{"queued":1,"running":2,"workers":3}}]})");
}

BOOST_AUTO_TEST_CASE(is_empty_without_other_nodes) {
    std::string out;
    cles::json_writer w{out};
    cles::core::write_peers(w, table.list(clock.now()), {});
    BOOST_TEST(out == R"({"peers":[]})");
}

BOOST_AUTO_TEST_SUITE_END()
