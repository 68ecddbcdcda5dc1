// SPDX-License-Identifier: BSL-1.0
#include "node/publish/multicast_group.hpp"
#include "support/watched_membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

namespace publisher_sources {
namespace {

using namespace std::chrono_literals;
using cles::core::group_source;

constexpr group_source here{0x0A000007, 40000};
constexpr group_source there{0x0A000008, 41000};
constexpr group_source elsewhere{0x0A000009, 42000};

using sources_verdict = cles::core::publisher_sources::verdict;

struct fixture : cles::test::watched_membership {
    void announce(const std::string& node, std::uint32_t epoch, std::uint64_t seq, const group_source& from) {
        table.apply_announcement({.node = node, .endpoints = {"tcp://0.0.0.0:1"}}, epoch, seq, from, clock.now());
    }
    bool admits(const std::string& node, const group_source& from) {
        last = sources.look(node, from, clock.now());
        return last != sources_verdict::refused;
    }

    cles::core::publisher_sources sources{table, 3};
    sources_verdict last{};
};

} // namespace
} // namespace publisher_sources

BOOST_FIXTURE_TEST_SUITE(publisher_sources, fixture)

BOOST_AUTO_TEST_CASE(a_node_that_announces_itself_is_accepted_from_its_source_only) {
    announce("car1", 1, 1, here);
    BOOST_TEST(admits("car1", here));
    BOOST_TEST(!admits("car1", there));
    pass(2s);
    BOOST_TEST(!admits("car1", there));
}

BOOST_AUTO_TEST_CASE(the_source_moves_with_the_name) {
    announce("car1", 1, 1, here);
    pass(3s);
    announce("car1", 2, 1, there);
    BOOST_TEST(!admits("car1", there));
    pass(500ms);
    BOOST_TEST(admits("car1", there));
    BOOST_TEST(!admits("car1", here));
}

BOOST_AUTO_TEST_CASE(a_node_without_announcements_is_bound_to_its_first_source) {
    BOOST_TEST(admits("car1", here));
    BOOST_TEST(!admits("car1", there));
    for (int i = 0; i < 10; ++i) {
        pass(3s);
        BOOST_TEST(admits("car1", here));
        BOOST_TEST(!admits("car1", there));
    }
    pass(3499ms);
    BOOST_TEST(!admits("car1", there));
    pass(1ms);
    BOOST_TEST(admits("car1", there));
    BOOST_TEST((last == sources_verdict::another));
    BOOST_TEST(!admits("car1", here));
}

BOOST_AUTO_TEST_CASE(a_node_is_accepted_from_all_the_sources_that_it_announces) {
    table.apply_announcement({.node = "car1", .endpoints = {"tcp://0.0.0.0:1"}, .sources = {here, there}}, 1, 1, here,
                             clock.now());
    BOOST_TEST(admits("car1", here));
    BOOST_TEST((last == sources_verdict::one_of_several));
    BOOST_TEST(admits("car1", there));
    BOOST_TEST(!admits("car1", elsewhere));
    announce("car2", 2, 1, elsewhere);
    BOOST_TEST(!admits("car2", there));
}

BOOST_AUTO_TEST_CASE(a_suspect_keeps_its_source_until_it_is_removed) {
    announce("car1", 1, 1, here);
    pass(4s);
    BOOST_TEST(admits("car1", here));
    BOOST_TEST(!admits("car1", there));
    pass(11s);
    BOOST_TEST(admits("car1", there));
}

BOOST_AUTO_TEST_CASE(a_node_known_only_from_others_is_bound_to_its_first_source) {
    table.apply_gossip({.announced = {.node = "car1", .endpoints = {"tcp://10.0.0.7:1"}}, .epoch = 1, .seq = 1},
                       cles::core::observed_source::of(here), clock.now(), clock.now());
    BOOST_TEST(admits("car1", here));
    BOOST_TEST(!admits("car1", there));
}

BOOST_AUTO_TEST_CASE(beyond_the_limit_the_least_recent_source_is_forgotten) {
    for (const auto* name : {"car1", "car2", "car3", "car4"}) {
        BOOST_TEST(admits(name, here));
        pass(1ms);
    }
    BOOST_TEST(sources.size() == 3U);
    BOOST_TEST(!admits("car4", there));
}

BOOST_AUTO_TEST_CASE(sources_of_another_pool_are_ignored_for_a_while) {
    sources.note_foreign(here, clock.now() + 15s);
    BOOST_TEST(sources.is_foreign(here, clock.now()));
    BOOST_TEST(!sources.is_foreign(there, clock.now()));
    pass(15s);
    BOOST_TEST(!sources.is_foreign(here, clock.now()));
    for (const auto& s : {here, there, elsewhere, group_source{1, 1}}) {
        sources.note_foreign(s, clock.now() + 15s);
    }
}

BOOST_AUTO_TEST_SUITE_END()
