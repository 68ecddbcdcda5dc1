// SPDX-License-Identifier: BSL-1.0
#include "port/shared_turns.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace shared_turns {
namespace {

using namespace std::chrono_literals;
using turns = cles::core::shared_turns<std::string>;
using turn = turns::turn;

struct fixture {
    int take_all(std::string_view source) {
        int taken = 0;
        while (all.take(source, now) != turn::refused) {
            ++taken;
        }
        return taken;
    }

    cles::time_point now{1h};
    turns all{{.share = {.per_second = 2, .at_once = 4},
               .shares = {.per_second = 100, .at_once = 200},
               .common = {.per_second = 10, .at_once = 20}}};
};

} // namespace
} // namespace shared_turns

BOOST_FIXTURE_TEST_SUITE(shared_turns, fixture)

BOOST_AUTO_TEST_CASE(a_source_has_its_share_and_what_is_common) {
    for (int i = 0; i < 4; ++i) {
        BOOST_TEST((all.take("a", now) == turn::of_share));
    }
    BOOST_TEST((all.take("a", now) == turn::of_common));
    BOOST_TEST(take_all("a") == 19);
    BOOST_TEST((all.take("a", now) == turn::refused));
    now += 1s;
    BOOST_TEST(take_all("a") == 2 + 10);
    now += 1h;
    BOOST_TEST(take_all("a") == 4 + 20);
}

BOOST_AUTO_TEST_CASE(others_cannot_use_up_a_share) {
    for (int i = 0; i < 1000; ++i) {
        static_cast<void>(all.take("greedy", now));
        now += 1ms;
    }
    BOOST_TEST(take_all("greedy") <= 2);
    BOOST_TEST(take_all("modest") == 4);
}

BOOST_AUTO_TEST_CASE(all_shares_together_are_limited) {
    int taken = 0;
    for (int i = 0; i < 1000; ++i) {
        taken += all.take(std::to_string(i), now) != turn::refused ? 1 : 0;
    }
    BOOST_TEST(taken == 200 + 20);
    now += 1s;
    for (int i = 1000; i < 2000; ++i) {
        taken += all.take(std::to_string(i), now) != turn::refused ? 1 : 0;
    }
    BOOST_TEST(taken == 200 + 20 + 100 + 10);
}

BOOST_AUTO_TEST_CASE(what_is_given_back_can_be_taken_again) {
    for (int i = 0; i < 10'000; ++i) {
        const auto taken = all.take("a", now);
        BOOST_REQUIRE((taken == turn::of_share));
        all.give_back("a", taken);
    }
    BOOST_TEST(take_all("a") == 4 + 20);
    all.give_back("a", turn::of_common);
    BOOST_TEST((all.take("b", now) == turn::of_share));
    BOOST_TEST((all.take("a", now) == turn::of_common));
    all.give_back("a", turn::refused);
    BOOST_TEST((all.take("a", now) == turn::refused));
    all.give_back("unknown", turn::of_share);
}

BOOST_AUTO_TEST_CASE(no_more_is_left_than_there_was) {
    for (int i = 0; i < 100; ++i) {
        all.give_back("a", turn::of_common);
        all.give_back("a", turn::of_share);
    }
    BOOST_TEST(take_all("a") == 4 + 20);
}

BOOST_AUTO_TEST_CASE(few_sources_are_remembered) {
    for (std::uint32_t i = 0; i < 100'000; ++i) {
        static_cast<void>(all.take(std::to_string(i), now));
        now += 1us;
    }
    BOOST_TEST(all.sources() == turns::most_sources);
    BOOST_TEST((all.take("new", now) == turn::refused)); // it has no share
    now += 10s;
    BOOST_TEST((all.take("new", now) == turn::of_share)); // the others need not be remembered any more
    BOOST_TEST(all.sources() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
