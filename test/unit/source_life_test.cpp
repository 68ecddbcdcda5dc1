// SPDX-License-Identifier: BSL-1.0
#include "core/source_life.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>

namespace source_life {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::core::source_life::keeper {
    [[nodiscard]] bool at_rest() const override { return rests; }
    void on_quiet() override { ++ends; }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    bool rests = true;
    int ends = 0;
    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::source_life life{*this, deadlines, clock.now()};
};

} // namespace
} // namespace source_life

BOOST_FIXTURE_TEST_SUITE(source_life, fixture)

BOOST_AUTO_TEST_CASE(a_source_is_let_go_after_a_minute_of_silence) {
    pass(59s);
    BOOST_TEST(ends == 0);
    pass(1s);
    BOOST_TEST(ends == 1);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(each_datagram_begins_the_minute_anew) {
    for (int i = 0; i < 10; ++i) {
        life.heard(clock.now());
        pass(50s);
    }
    BOOST_TEST(ends == 0);
    pass(10s);
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(it_stays_while_something_is_kept_for_it) {
    rests = false;
    pass(10min);
    BOOST_TEST(ends == 0);
    rests = true;
    pass(1min);
    BOOST_TEST(ends == 1);
}

BOOST_AUTO_TEST_CASE(once_ended_it_says_nothing) {
    life.end();
    pass(1h);
    BOOST_TEST(ends == 0);
}

BOOST_AUTO_TEST_SUITE_END()
