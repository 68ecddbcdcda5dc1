// SPDX-License-Identifier: BSL-1.0
#include "node/routing/load_balancer.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <vector>

BOOST_AUTO_TEST_SUITE(power_of_two_choices)

using cles::core::candidate;

namespace {

candidate with(cles::node_load load) {
    candidate c;
    c.update_load(load);
    return c;
}

} // namespace

BOOST_AUTO_TEST_CASE(none_of_none_and_the_one_of_one) {
    cles::core::power_of_two_choices draw{1};
    BOOST_TEST(draw.select({}) == nullptr);
    candidate only;
    std::array<candidate*, 1> all{&only};
    BOOST_TEST(draw.select(all) == &only);
}

BOOST_AUTO_TEST_CASE(less_work_is_better) {
    BOOST_TEST(is_better(with({.queued = 1}), with({.queued = 2})));
    BOOST_TEST(is_better(with({.running = 1}), with({.queued = 1, .running = 1})));
    BOOST_TEST(!is_better(with({.queued = 2}), with({.queued = 2})));
}

BOOST_AUTO_TEST_CASE(more_workers_carry_more) {
    BOOST_TEST(is_better(with({.queued = 4, .workers = 8}), with({.queued = 2, .workers = 2})));
    BOOST_TEST(!is_better(with({.queued = 4, .workers = 2}), with({.queued = 2, .workers = 2})));
}

BOOST_AUTO_TEST_CASE(faster_node_may_have_more_work) {
    BOOST_TEST(is_better(with({.queued = 4, .workers = 1, .service_us = 100}),
                         with({.queued = 1, .workers = 1, .service_us = 1000})));
    // If one does not report it, it does not count.
    BOOST_TEST(!is_better(with({.queued = 4, .workers = 1, .service_us = 100}), with({.queued = 1, .workers = 1})));
}

BOOST_AUTO_TEST_CASE(work_given_since_the_report_counts_and_work_ended_since_does_not) {
    candidate c;
    c.given = 3;
    c.update_load({.queued = 2, .running = 1});
    BOOST_TEST(c.estimated_work() == 3U);
    c.given = 5;
    BOOST_TEST(c.estimated_work() == 5U);
    c.given = 0;
    BOOST_TEST(c.estimated_work() == 0U);
}

BOOST_AUTO_TEST_CASE(equal_nodes_are_drawn_equally_often) {
    cles::core::power_of_two_choices draw{7};
    std::vector<candidate> nodes(10);
    std::vector<candidate*> all;
    for (auto& n : nodes) {
        all.push_back(&n);
    }
    std::map<const candidate*, int> drawn;
    constexpr int draws = 10'000;
    for (int i = 0; i < draws; ++i) {
        ++drawn[draw.select(all)];
    }
    BOOST_TEST(drawn.size() == nodes.size());
    for (const auto& [node, times] : drawn) {
        BOOST_TEST(times > draws / 10 * 8 / 10);
        BOOST_TEST(times < draws / 10 * 12 / 10);
    }
}

BOOST_AUTO_TEST_CASE(the_worst_of_all_is_never_chosen) {
    cles::core::power_of_two_choices draw{7};
    std::vector<candidate> nodes(3);
    nodes[1].update_load({.queued = 100});
    std::vector<candidate*> all{&nodes[0], &nodes[1], &nodes[2]};
    for (int i = 0; i < 1000; ++i) {
        BOOST_TEST(draw.select(all) != &nodes[1]);
    }
}

BOOST_AUTO_TEST_CASE(better_of_two_keeps_queues_short_with_outdated_loads) {
    cles::core::power_of_two_choices draw{7};
    std::vector<candidate> nodes(100);
    std::vector<candidate*> all;
    for (auto& n : nodes) {
        all.push_back(&n);
    }
    for (int i = 0; i < 1000; ++i) { // ten for each, without any report
        ++draw.select(all)->given;
    }
    const auto worst =
        std::max_element(nodes.begin(), nodes.end(), [](const auto& a, const auto& b) { return a.given < b.given; });
    BOOST_TEST(worst->given <= 13U); // at random it would be about 18
}

BOOST_AUTO_TEST_SUITE_END()
