// SPDX-License-Identifier: BSL-1.0
#include "daemon/idle_memory.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>

namespace idle_memory {
namespace {

using namespace std::chrono_literals;
using cles::runtime::process_usage;

constexpr std::uint64_t mib = std::uint64_t{1} << 20U;

process_usage usage(std::uint64_t resident_mib, std::uint64_t unused_mib, std::chrono::nanoseconds cpu_time = 0s) {
    return {.resident = resident_mib * mib, .unused = unused_mib * mib, .cpu_time = cpu_time};
}

} // namespace

BOOST_AUTO_TEST_SUITE(idle_memory)

using cles::runtime::usage_of_process;

BOOST_AUTO_TEST_CASE(what_was_used_at_the_start_is_left) {
    cles::runtime::idle_memory memory{usage(20, 3)};
    BOOST_TEST(!memory.is_time(usage(20, 3)));
    BOOST_TEST(!memory.is_time(usage(15, 1)));
}

BOOST_AUTO_TEST_CASE(memory_that_was_freed_is_returned_once) {
    cles::runtime::idle_memory memory{usage(20, 3)};
    BOOST_TEST(memory.is_time(usage(30, 13)));
    memory.returned(usage(20, 13)); // the C library still counts it
    BOOST_TEST(!memory.is_time(usage(20, 13)));
    BOOST_TEST(memory.is_time(usage(20, 14)));
}

BOOST_AUTO_TEST_CASE(less_than_a_mebibyte_is_left) {
    cles::runtime::idle_memory memory{usage(20, 3)};
    auto now = usage(21, 4);
    --now.resident;
    --now.unused;
    BOOST_TEST(!memory.is_time(now));
    ++now.unused;
    BOOST_TEST(memory.is_time(now));
}

// Between two questions, it was used and freed.
BOOST_AUTO_TEST_CASE(memory_that_was_used_again_is_returned_again) {
    cles::runtime::idle_memory memory{usage(20, 3)};
    BOOST_TEST(memory.is_time(usage(30, 13)));
    memory.returned(usage(20, 13));
    BOOST_TEST(memory.is_time(usage(28, 13)));
}

BOOST_AUTO_TEST_CASE(a_process_that_works_keeps_its_memory) {
    cles::runtime::idle_memory memory{usage(20, 3, 1s)};
    BOOST_TEST(!memory.is_time(usage(30, 13, 1251ms)));
    BOOST_TEST(!memory.is_time(usage(30, 13, 6s)));
    BOOST_TEST(memory.is_time(usage(30, 13, 6250ms)));
}

BOOST_AUTO_TEST_CASE(the_system_tells_what_this_process_uses) {
    const auto before = usage_of_process();
    BOOST_TEST(before.resident > mib);
    auto now = usage_of_process();
    while (now.cpu_time == before.cpu_time) { // asking takes time, too
        now = usage_of_process();
    }
    BOOST_TEST((now.cpu_time > before.cpu_time));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace idle_memory
