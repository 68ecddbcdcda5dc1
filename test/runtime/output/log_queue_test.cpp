// SPDX-License-Identifier: BSL-1.0
#include "output/log_queue.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <string>

BOOST_AUTO_TEST_SUITE(log_queue)

BOOST_AUTO_TEST_CASE(lines_come_in_order) {
    tool::log_queue queue;
    BOOST_TEST(!queue.take());
    queue.add("a\n");
    queue.add("b\n");
    for (const auto* line : {"a\n", "b\n"}) {
        const auto next = queue.take();
        BOOST_TEST_REQUIRE(next.has_value());
        BOOST_TEST(next->line == line);
        BOOST_TEST(next->dropped == 0U);
    }
    BOOST_TEST(queue.empty());
}

BOOST_AUTO_TEST_CASE(what_does_not_fit_is_counted_where_it_is_missing) {
    tool::log_queue queue;
    const auto most = tool::log_queue::most_lines;
    for (std::size_t i = 0; i < most + 5; ++i) {
        queue.add("line\n");
    }
    BOOST_TEST(queue.take()->dropped == 0U);
    queue.add("after\n");
    for (std::size_t i = 1; i < most; ++i) {
        BOOST_TEST(queue.take()->dropped == 0U);
    }
    const auto last = queue.take();
    BOOST_TEST(last->line == "after\n");
    BOOST_TEST(last->dropped == 5U);
    BOOST_TEST(queue.empty());
}

BOOST_AUTO_TEST_CASE(dropped_lines_are_told_although_none_follows) {
    tool::log_queue queue;
    const std::string long_line(tool::log_queue::most_bytes, 'x');
    queue.add(long_line); // a single one may have any length
    queue.add("dropped\n");
    BOOST_TEST(queue.take()->line.size() == long_line.size());
    BOOST_TEST(!queue.empty());
    const auto next = queue.take();
    BOOST_TEST(next->line.empty());
    BOOST_TEST(next->dropped == 1U);
    BOOST_TEST(!queue.take());
}

BOOST_AUTO_TEST_CASE(its_bytes_are_limited) {
    tool::log_queue queue;
    const std::string line(tool::log_queue::most_bytes / 8, 'x');
    for (int i = 0; i < 100; ++i) {
        queue.add(line);
    }
    std::size_t bytes = 0;
    std::uint64_t dropped = 0;
    while (const auto next = queue.take()) {
        bytes += next->line.size();
        dropped += next->dropped;
    }
    BOOST_TEST(bytes == tool::log_queue::most_bytes);
    BOOST_TEST(dropped == 92U);
}

BOOST_AUTO_TEST_SUITE_END()
