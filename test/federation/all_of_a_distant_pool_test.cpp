// SPDX-License-Identifier: BSL-1.0
#include "federation/bridge.hpp"
#include "simulated_nats.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <string>

namespace all_of_a_distant_pool {
namespace {

using namespace std::chrono_literals;
using cles::bridging::bridge_link;
using cles::bridging::test::simulated_nats;
using cles::bridging::test::site;

/// The node of the bridge of north, which routes as nodes do: of its neighbours, car3 answers at once, and car2 never.
class north_node : public cles::test::routing_fixture {
  public:
    explicit north_node(site& by) : by_(by) {
        offer("car2", task("PULL", "speed"));
        offer("car3", task("PULL", "speed"));
        by_.serves = [this](const bridge_link& on, const std::string& line) {
            link.session().on_line(line, node.clock.now());
            if (ways.to("car3").open()) {
                ways.to("car3").answers("3");
            }
            pass_on(on);
        };
    }
    void pass(std::chrono::milliseconds by, cles::time_point now) {
        node.pass(by);
        now_ = now;
        pass_on({bridge_link::role::from_pool, "south"});
    }

  private:
    void pass_on(const bridge_link& on) {
        for (const auto& line : link.take_lines()) {
            by_.core().on_line(on, line, now_);
        }
    }

    site& by_;
    cles::time_point now_{};
};

struct distant_pools {
    simulated_nats nats{1};
    site hub{nats, "south", "hub"};
    site gate{nats, "north", "gate"};
    north_node north{gate};

    void run_for(std::chrono::milliseconds time) {
        for (; time > 0ms; time -= 1ms) {
            nats.run_for(1ms);
            north.pass(1ms, nats.now());
        }
    }
    /// \param one_way between the pools
    void meet(std::chrono::milliseconds one_way) {
        nats.impair() = {.shortest_delay = one_way, .longest_delay = one_way};
        hub.connect();
        gate.connect();
        nats.run_for(4s);
        BOOST_REQUIRE(hub.core().is_live("north"));
    }
    /// What the hub gets within the time that it has for north, as a part of its own `all`.
    std::string ask(std::chrono::milliseconds deadline, const std::string& target = "north.all") {
        const auto id = hub.ask("north", "PULL " + target + ":speed deadline=" + std::to_string(deadline.count()) +
                                             " hops=7 via=hub");
        run_for(deadline);
        return hub.answer(id);
    }
};

constexpr auto all_but_car2 =
    R"({"results":{"car3":3},"errors":{"car2":{"error":"deadline","message":"car2 did not answer in time"}}})";

} // namespace
} // namespace all_of_a_distant_pool

BOOST_AUTO_TEST_SUITE(all_of_a_distant_pool)

BOOST_AUTO_TEST_CASE(who_answered_is_in_the_reply_whatever_the_way_takes) {
    for (const auto one_way : {0ms, 20ms, 50ms, 100ms}) {
        for (const auto deadline : {500ms, 950ms, 4950ms, 29950ms}) {
            BOOST_TEST_CONTEXT("one way " << one_way.count() << " ms, deadline " << deadline.count() << " ms") {
                distant_pools pools;
                pools.meet(one_way);
                if (deadline < 8 * one_way) { // a quarter is too short before the way is known
                    pools.ask(deadline);
                }
                BOOST_TEST(pools.ask(deadline) == all_but_car2);
            }
        }
    }
}

BOOST_AUTO_TEST_CASE(a_way_that_takes_most_of_the_time_is_measured) {
    distant_pools pools;
    pools.meet(300ms);
    BOOST_TEST(pools.ask(950ms).empty()); // so far, nothing is known of the way
    pools.run_for(1s);
    BOOST_TEST(pools.ask(950ms) == all_but_car2);
}

BOOST_AUTO_TEST_SUITE_END()
