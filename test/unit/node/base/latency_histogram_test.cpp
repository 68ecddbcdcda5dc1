// SPDX-License-Identifier: BSL-1.0
#include "node/base/metrics.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

namespace latency_histogram {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

// The quantile is the upper bound of a bucket whose width is an eighth.
bool is_about(nanoseconds measured, nanoseconds actual) {
    return measured >= actual && measured <= actual + actual / 8 + 1ns;
}

} // namespace
} // namespace latency_histogram

BOOST_AUTO_TEST_SUITE(latency_histogram)

BOOST_AUTO_TEST_CASE(nothing_recorded_gives_zero) {
    const cles::core::latency_histogram h;
    BOOST_TEST(h.count() == 0U);
    BOOST_CHECK(h.quantile(0.5) == 0ns);
    BOOST_CHECK(h.quantile(0.999) == 0ns);
}

BOOST_AUTO_TEST_CASE(one_duration_is_every_quantile) {
    for (const nanoseconds one :
         {0ns, 1ns, 7ns, 8ns, 9ns, 1023ns, 1024ns, 12345ns, nanoseconds{1s}, nanoseconds{20min}}) {
        cles::core::latency_histogram h;
        h.record(one);
        BOOST_TEST(h.count() == 1U);
        for (const double q : {0.0, 0.5, 0.99, 0.999, 1.0}) {
            BOOST_TEST(is_about(h.quantile(q), one), one.count() << " ns gives " << h.quantile(q).count());
        }
    }
}

BOOST_AUTO_TEST_CASE(a_quantile_is_accurate_to_an_eighth) {
    std::mt19937 random{5};
    std::vector<nanoseconds> all;
    cles::core::latency_histogram h;
    for (int i = 0; i < 20'000; ++i) {
        const nanoseconds d{static_cast<std::int64_t>(std::exp(std::uniform_real_distribution{0.0, 23.0}(random)))};
        all.push_back(d);
        h.record(d);
    }
    std::sort(all.begin(), all.end());
    for (const double q : {0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0}) {
        const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(all.size())));
        BOOST_TEST(is_about(h.quantile(q), all[rank - 1]), "quantile " << q);
    }
}

BOOST_AUTO_TEST_CASE(a_high_quantile_of_few_is_the_greatest) {
    cles::core::latency_histogram h;
    h.record(1ms);
    h.record(100ms);
    BOOST_TEST(is_about(h.quantile(0.5), 1ms));
    BOOST_TEST(is_about(h.quantile(0.99), 100ms));
}

BOOST_AUTO_TEST_CASE(durations_out_of_range_count_at_the_end) {
    cles::core::latency_histogram h;
    h.record(-5ns);
    BOOST_CHECK(h.quantile(1.0) == 0ns);
    h.record(nanoseconds::max());
    BOOST_TEST(h.count() == 2U);
    BOOST_CHECK(h.quantile(1.0) >= nanoseconds{1h});
}

BOOST_AUTO_TEST_SUITE_END()
