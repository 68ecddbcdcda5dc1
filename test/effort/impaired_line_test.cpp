// SPDX-License-Identifier: BSL-1.0
#include "perf/links/impaired_line.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstddef>
#include <vector>

using bad_line = cles::perf::impaired_line;
using cles::perf::impairment;
using namespace std::chrono_literals;

namespace impaired_line {
namespace {

using clock_type = bad_line::clock;

const clock_type::time_point start{1h};

bad_line::frame frame_of(std::size_t size, int mark = 0) { return bad_line::frame(size, static_cast<std::byte>(mark)); }

double milliseconds(clock_type::duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

/// The arrival time of each of this many frames, sent at this interval.
std::vector<clock_type::time_point> arrivals(bad_line& line, int frames, clock_type::duration interval) {
    std::vector<clock_type::time_point> found;
    for (int i = 0; i < frames; ++i) {
        line.send(start + i * interval, frame_of(100));
        while (const auto at = line.next_arrival()) {
            if (*at > start + (i + 1) * interval) {
                break;
            }
            BOOST_REQUIRE(line.receive(*at).has_value());
            found.push_back(*at);
        }
    }
    while (const auto at = line.next_arrival()) {
        BOOST_REQUIRE(line.receive(*at).has_value());
        found.push_back(*at);
    }
    return found;
}

} // namespace
} // namespace impaired_line

BOOST_AUTO_TEST_SUITE(impaired_line)

BOOST_AUTO_TEST_CASE(a_perfect_line_hands_over_at_once) {
    bad_line line{{}, 1};
    BOOST_TEST(!line.next_arrival().has_value());
    line.send(start, frame_of(3, 7));
    BOOST_TEST((line.next_arrival() == start));
    BOOST_TEST((line.receive(start) == frame_of(3, 7)));
    BOOST_TEST(!line.receive(start).has_value());
    BOOST_TEST(line.carried() == 1U);
}

BOOST_AUTO_TEST_CASE(a_frame_arrives_after_the_delay_and_not_before) {
    bad_line line{{.delay = 5ms}, 1};
    line.send(start, frame_of(100));
    BOOST_TEST(!line.receive(start + 5ms - 1ns).has_value());
    BOOST_TEST(line.receive(start + 5ms).has_value());
}

BOOST_AUTO_TEST_CASE(each_frame_takes_the_line_for_its_length) {
    bad_line line{{.delay = 1ms, .bits_per_s = 64'000}, 1}; // 8 bytes a millisecond
    line.send(start, frame_of(80));
    line.send(start, frame_of(160));
    line.send(start + 1s, frame_of(8)); // the line has been idle for long: unused capacity is not saved
    const auto next = [&] {
        const auto at = line.next_arrival();
        BOOST_REQUIRE(at.has_value());
        BOOST_REQUIRE(line.receive(*at).has_value());
        return milliseconds(*at - start);
    };
    BOOST_TEST(next() == 11.0);
    BOOST_TEST(next() == 31.0);
    BOOST_TEST(next() == 1002.0);
}

BOOST_AUTO_TEST_CASE(jitter_has_its_mean_and_keeps_the_order) {
    bad_line line{{.delay = 2ms, .jitter = 1ms}, 1};
    const int frames = 20'000;
    const auto interval = 100ms; // long enough that no frame delays the next
    const auto found = arrivals(line, frames, interval);
    BOOST_REQUIRE(found.size() == std::size_t{frames});
    double sum = 0;
    double most = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
        const double took = milliseconds(found[i] - start) - 100.0 * static_cast<double>(i);
        BOOST_TEST_REQUIRE(took >= 2.0);
        sum += took - 2.0;
        most = std::max(most, took - 2.0);
    }
    BOOST_TEST(sum / frames == 1.0, boost::test_tools::tolerance(0.05));
    BOOST_TEST(most > 5.0);
    BOOST_TEST(most <= 20.0);

    bad_line dense{{.jitter = 10ms}, 1};
    const auto close = arrivals(dense, 1000, 100us);
    BOOST_TEST(std::is_sorted(close.begin(), close.end()));
}

BOOST_AUTO_TEST_CASE(the_share_that_is_lost_is_as_set_and_the_seed_decides_which) {
    const impairment lossy{.loss = 0.1, .queue = 100'000};
    const auto pattern = [&](std::uint64_t seed) {
        bad_line line{lossy, seed};
        std::vector<bool> lost;
        for (int i = 0; i < 20'000; ++i) {
            line.send(start, frame_of(1));
            lost.push_back(!line.receive(start).has_value());
        }
        BOOST_TEST(static_cast<double>(line.lost()) == 2000.0, boost::test_tools::tolerance(0.1));
        BOOST_TEST(line.lost() + line.carried() == 20'000U);
        return lost;
    };
    BOOST_TEST((pattern(1) == pattern(1)));
    BOOST_TEST((pattern(1) != pattern(2)));
}

BOOST_AUTO_TEST_CASE(a_lost_frame_takes_the_line_all_the_same) {
    bad_line line{{.loss = 1, .bits_per_s = 64'000, .queue = 2}, 1};
    for (int i = 0; i < 10; ++i) {
        line.send(start, frame_of(8));
    }
    BOOST_TEST(line.lost() == 10U);
    BOOST_TEST(line.overflown() == 0U);
    BOOST_TEST(!line.next_arrival().has_value());
}

BOOST_AUTO_TEST_CASE(what_does_not_fit_is_dropped_and_counted) {
    bad_line line{{.delay = 1s, .queue = 3}, 1};
    for (int i = 0; i < 5; ++i) {
        line.send(start, frame_of(1, i));
    }
    BOOST_TEST(line.overflown() == 2U);
    for (int i = 0; i < 3; ++i) {
        BOOST_TEST((line.receive(start + 1s) == frame_of(1, i)));
    }
    BOOST_TEST(!line.receive(start + 1h).has_value());
    line.send(start + 1s, frame_of(1));
    BOOST_TEST(line.next_arrival().has_value());
}

BOOST_AUTO_TEST_SUITE_END()
