// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/replay_window.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <vector>

namespace replay_window {
namespace {

using window = cles::security::replay_window;

bool accept(window& of, std::uint64_t counter) {
    if (!of.accepts(counter)) {
        return false;
    }
    of.note(counter);
    return true;
}

// The page, word by word.
class model {
  public:
    explicit model(std::uint64_t first) : first_(first) {}
    bool accept(std::uint64_t counter) {
        if (counter < first_ || seen_.contains(counter) ||
            (!seen_.empty() && *seen_.rbegin() >= counter && *seen_.rbegin() - counter >= 1024)) {
            return false;
        }
        seen_.insert(counter);
        return true;
    }

  private:
    std::uint64_t first_;
    std::set<std::uint64_t> seen_;
};

} // namespace

BOOST_AUTO_TEST_SUITE(replay_window)

BOOST_AUTO_TEST_CASE(each_counter_is_accepted_once_in_any_order) {
    std::vector<std::uint64_t> counters(1024);
    for (std::size_t i = 0; i < counters.size(); ++i) {
        counters[i] = 17 + i;
    }
    std::mt19937_64 random{1};
    std::ranges::shuffle(counters, random);
    window w{17};
    BOOST_TEST(std::ranges::all_of(counters, [&](auto counter) { return accept(w, counter); }));
    BOOST_TEST(std::ranges::none_of(counters, [&](auto counter) { return accept(w, counter); }));
}

BOOST_AUTO_TEST_CASE(none_before_the_first_is_accepted) {
    window w{17};
    BOOST_TEST(!accept(w, 16));
    BOOST_TEST(!accept(w, 0));
    BOOST_TEST(accept(w, 17));
    BOOST_TEST(!accept(w, 16));
}

BOOST_AUTO_TEST_CASE(none_that_is_1024_or_more_below_the_highest_is_accepted) {
    window w;
    BOOST_TEST(accept(w, 5000));
    BOOST_TEST(!accept(w, 5000 - 1024));
    BOOST_TEST(accept(w, 5000 - 1023));
    BOOST_TEST(!accept(w, 0));
}

BOOST_AUTO_TEST_CASE(the_highest_counters_are_accepted_once) {
    const auto last = std::numeric_limits<std::uint64_t>::max();
    window w{last - 2};
    BOOST_TEST(accept(w, last));
    BOOST_TEST(!accept(w, last));
    BOOST_TEST(accept(w, last - 2));
    BOOST_TEST(!accept(w, last - 2));
    BOOST_TEST(!accept(w, last - 3));
    BOOST_TEST(!accept(w, 0));
}

BOOST_AUTO_TEST_CASE(asking_changes_nothing) {
    window w;
    BOOST_TEST(w.accepts(3));
    BOOST_TEST(w.accepts(3));
    w.note(3);
    BOOST_TEST(!w.accepts(3));
    BOOST_TEST(w.highest() == 3U);
}

BOOST_AUTO_TEST_CASE(it_agrees_with_a_set_of_all_counters) {
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
        std::mt19937_64 random{seed};
        const auto first = random() % 3 == 0 ? 0 : random() >> random() % 60;
        window w{first};
        model expected{first};
        auto around = first;
        for (int i = 0; i < 3000; ++i) {
            const auto step = random() % 10;
            around += step == 0 ? random() % 3000 : step < 3 ? random() % 70 : 1;
            const auto back = random() % 4 == 0 ? random() % 1100 : random() % 3;
            const auto counter = around - std::min(around, back);
            BOOST_REQUIRE_MESSAGE(accept(w, counter) == expected.accept(counter), "seed " << seed << ", " << counter);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace replay_window
