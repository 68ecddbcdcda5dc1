// SPDX-License-Identifier: BSL-1.0
#include "node/membership/discovery.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <set>
#include <vector>

namespace announcer {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::announcer::sender {
    void announce(std::chrono::milliseconds i) override {
        times.push_back(clock.now());
        interval = i;
    }
    [[nodiscard]] std::size_t others() const override { return known; }

    void pass(std::chrono::milliseconds by) {
        for (auto i = 0ms; i < by; ++i) {
            clock.advance(1ms);
            deadlines.expire(clock.now());
        }
    }
    void begin() {
        node.start(clock.now());
        deadlines.expire(clock.now());
    }
    [[nodiscard]] std::chrono::milliseconds last_gap() const {
        return std::chrono::duration_cast<std::chrono::milliseconds>(times.back() - times[times.size() - 2]);
    }

    std::vector<cles::time_point> times;
    std::chrono::milliseconds interval{0};
    std::size_t known = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::announcer node{*this, deadlines, 7};
};

} // namespace
} // namespace announcer

BOOST_FIXTURE_TEST_SUITE(announcer, fixture)

BOOST_AUTO_TEST_CASE(announces_at_start) {
    node.expedite(clock.now());
    node.solicited(clock.now());
    BOOST_TEST(!deadlines.next()); // not started yet
    begin();
    BOOST_TEST(times.size() == 1U);
}

BOOST_AUTO_TEST_CASE(then_announces_within_each_interval_with_jitter) {
    begin();
    std::set<std::chrono::milliseconds> gaps;
    for (int i = 0; i < 50; ++i) {
        pass(1s);
        BOOST_TEST((last_gap() >= 750ms));
        BOOST_TEST((last_gap() <= 1s));
        gaps.insert(last_gap());
    }
    BOOST_TEST((interval == 1s));
    BOOST_TEST(gaps.size() > 10U);
}

BOOST_AUTO_TEST_CASE(interval_grows_by_10_ms_per_node) {
    known = 99; // plus this node
    begin();
    BOOST_TEST((interval == 1s));
    known = 499;
    pass(1s);
    BOOST_TEST((interval == 5s));
    const auto so_far = times.size();
    pass(3700ms);
    BOOST_TEST(times.size() == so_far);
    pass(1300ms);
    BOOST_TEST(times.size() == so_far + 1);
}

BOOST_AUTO_TEST_CASE(interval_is_bounded) {
    known = 1'000'000;
    begin();
    BOOST_TEST((interval == 60s));
}

BOOST_AUTO_TEST_CASE(solicitation_by_name_does_not_wait) {
    begin();
    pass(500ms);
    node.expedite(clock.now());
    deadlines.expire(clock.now());
    BOOST_TEST(times.size() == 2U);
    BOOST_TEST((last_gap() == 500ms));
}

BOOST_AUTO_TEST_CASE(many_solicitations_by_name_are_answered_together_after_a_pause) {
    begin();
    pass(10ms);
    for (int i = 0; i < 200; ++i) { // for 200 ms
        node.expedite(clock.now());
        pass(1ms);
    }
    BOOST_TEST(times.size() == 3U);
    BOOST_TEST((last_gap() == 100ms));
}

BOOST_AUTO_TEST_CASE(solicitation_is_answered_within_250_ms_with_jitter) {
    known = 99;
    std::set<std::chrono::milliseconds> waits;
    for (std::uint32_t seed = 1; seed < 50; ++seed) {
        cles::core::announcer one{*this, deadlines, seed * 7919};
        one.start(clock.now());
        deadlines.expire(clock.now());
        pass(200ms);
        const auto asked = clock.now();
        const auto before = times.size();
        one.solicited(asked);
        pass(250ms);
        BOOST_REQUIRE(times.size() == before + 1);
        waits.insert(std::chrono::duration_cast<std::chrono::milliseconds>(times.back() - asked));
    }
    BOOST_TEST(waits.size() > 10U);
}

BOOST_AUTO_TEST_CASE(solicitation_is_answered_sooner_if_few_nodes_are_known) {
    known = 3; // plus this node
    for (std::uint32_t seed = 1; seed < 50; ++seed) {
        cles::core::announcer one{*this, deadlines, seed * 7919};
        one.start(clock.now());
        deadlines.expire(clock.now());
        pass(200ms);
        const auto before = times.size();
        one.solicited(clock.now());
        pass(40ms);
        BOOST_TEST(times.size() == before + 1);
    }
}

BOOST_AUTO_TEST_CASE(many_solicitations_have_one_answer) {
    begin();
    pass(200ms);
    for (int i = 0; i < 1000; ++i) {
        node.solicited(clock.now());
    }
    pass(250ms);
    BOOST_TEST(times.size() == 2U);
}

BOOST_AUTO_TEST_CASE(pauses_between_answers_to_many_solicitations) {
    begin();
    for (int i = 0; i < 1000; ++i) {
        node.solicited(clock.now());
        node.expedite(clock.now());
        pass(1ms);
    }
    BOOST_TEST(times.size() <= 11U);
}

BOOST_AUTO_TEST_CASE(solicitation_right_after_an_announcement_is_answered_too) {
    begin();
    pass(1ms);
    node.solicited(clock.now());
    pass(250ms);
    BOOST_TEST(times.size() == 2U);
}

BOOST_AUTO_TEST_CASE(does_not_announce_after_stop) {
    begin();
    node.stop();
    node.expedite(clock.now());
    node.solicited(clock.now());
    pass(5s);
    BOOST_TEST(times.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
