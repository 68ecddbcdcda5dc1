// SPDX-License-Identifier: BSL-1.0
#include "primes/prime_counter.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <utility>

namespace prime_counter {
namespace {

std::pair<std::uint64_t, std::uint64_t> counted(std::uint64_t from, std::uint64_t below) {
    primes::prime_counter counter{from, below};
    while (counter.step()) {
    }
    return {counter.count(), counter.largest()};
}

} // namespace
} // namespace prime_counter

BOOST_AUTO_TEST_SUITE(prime_counter)

BOOST_AUTO_TEST_CASE(it_counts_the_primes_of_a_range) {
    BOOST_TEST((counted(0, 2) == std::pair<std::uint64_t, std::uint64_t>{0, 0}));
    BOOST_TEST((counted(0, 3) == std::pair<std::uint64_t, std::uint64_t>{1, 2}));
    BOOST_TEST((counted(0, 100) == std::pair<std::uint64_t, std::uint64_t>{25, 97}));
    BOOST_TEST((counted(90, 97) == std::pair<std::uint64_t, std::uint64_t>{0, 0}));
    BOOST_TEST((counted(0, 1'000'000) == std::pair<std::uint64_t, std::uint64_t>{78498, 999983}));
    BOOST_TEST((counted(10, 5) == std::pair<std::uint64_t, std::uint64_t>{0, 0}));
}

BOOST_AUTO_TEST_CASE(parts_add_up) {
    std::uint64_t sum = 0;
    for (std::uint64_t i = 0; i < 7; ++i) {
        sum += counted(1'000'000 * i / 7, 1'000'000 * (i + 1) / 7).first;
    }
    BOOST_TEST(sum == 78498U);
}

BOOST_AUTO_TEST_CASE(it_tells_how_far_it_is) {
    primes::prime_counter counter{0, 1'000'000};
    double before = 0;
    BOOST_TEST(counter.part_done() == 0);
    while (counter.step()) {
        BOOST_TEST(counter.part_done() > before);
        before = counter.part_done();
    }
    BOOST_TEST(counter.part_done() == 1);
    BOOST_TEST(!counter.step());
}

BOOST_AUTO_TEST_CASE(a_number_is_prime_or_not) {
    for (const std::uint64_t n : {2U, 3U, 5U, 97U, 999983U}) {
        BOOST_TEST(primes::is_prime(n));
    }
    for (const std::uint64_t n : {0U, 1U, 4U, 9U, 91U, 999981U}) {
        BOOST_TEST(!primes::is_prime(n));
    }
    BOOST_TEST(primes::is_prime(999'999'999'989));
}

BOOST_AUTO_TEST_SUITE_END()
