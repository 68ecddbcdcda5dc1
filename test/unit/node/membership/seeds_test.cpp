// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_contacts.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

namespace seeds {
namespace {

using namespace std::chrono_literals;

struct fixture {
    std::string due(std::chrono::milliseconds rest = 2s) { return all.due(others, now, rest).value_or("nobody"); }
    void know(const std::string& node) {
        const cles::core::announcement said{.node = node, .endpoints = {"tcp://10.0.0.1:1"}};
        others.apply_announcement(said, ++epoch, 1, {0x0A000001, 1}, now);
    }

    cles::time_point now{1h};
    cles::core::deadline_queue deadlines;
    cles::core::membership others{"me", 0xAAAA, deadlines, 10};
    cles::core::seeds all{7};
    std::uint32_t epoch = 0;
};

} // namespace
} // namespace seeds

BOOST_FIXTURE_TEST_SUITE(seeds, fixture)

BOOST_AUTO_TEST_CASE(all_seeds_are_due_at_once) {
    all.set({"tcp://a:1", "tcp://b:1", "tcp://a:1"});
    BOOST_TEST(due() == "tcp://a:1");
    BOOST_TEST(due() == "tcp://b:1");
    BOOST_TEST(due() == "nobody");
}

BOOST_AUTO_TEST_CASE(pauses_double_up_to_a_limit) {
    all.set({"tcp://a:1"});
    auto last = now;
    std::vector<std::chrono::milliseconds> pauses;
    for (int i = 0; i < 7; ++i) {
        BOOST_TEST(due() == "tcp://a:1");
        pauses.push_back(std::chrono::duration_cast<std::chrono::milliseconds>(*all.next() - now));
        last = now;
        now = *all.next();
    }
    BOOST_TEST((pauses[0] <= 250ms));
    BOOST_TEST((pauses[0] >= 187ms));
    BOOST_TEST((pauses[1] > pauses[0]));
    BOOST_TEST((pauses[6] <= 2s));
    BOOST_TEST((pauses[6] >= 1500ms));
}

BOOST_AUTO_TEST_CASE(seed_is_not_asked_while_its_node_is_live) {
    all.set({"tcp://a:1"});
    due();
    all.on_answer("tcp://a:1", "car1");
    know("car1");
    for (int i = 0; i < 3; ++i) {
        now = *all.next();
        deadlines.expire(now);
        BOOST_TEST(due(1s) == "nobody");
    }
    now += 4s;
    deadlines.expire(now); // suspect
    BOOST_TEST(due(1s) == "tcp://a:1");
}

BOOST_AUTO_TEST_CASE(this_node_itself_is_not_asked) {
    all.set({"tcp://a:1"});
    due();
    all.on_self("tcp://a:1");
    BOOST_TEST(!all.next());
    now += 1h;
    BOOST_TEST(due() == "nobody");
}

BOOST_AUTO_TEST_CASE(remaining_seeds_keep_their_pause) {
    all.set({"tcp://a:1"});
    due();
    all.set({"tcp://b:1", "tcp://a:1"});
    BOOST_TEST(due() == "tcp://b:1");
    BOOST_TEST(due() == "nobody");
    all.set({});
    BOOST_TEST(all.empty());
    BOOST_TEST(!all.next());
}

BOOST_AUTO_TEST_SUITE_END()
