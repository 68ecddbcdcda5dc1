// SPDX-License-Identifier: BSL-1.0
#include "node/publish/topic.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <deque>
#include <random>
#include <string>
#include <string_view>

namespace update_log {
namespace {

void append(cles::core::update_log& log, std::string_view line) {
    log.begin().append(line);
    log.commit();
}

} // namespace
} // namespace update_log

BOOST_AUTO_TEST_SUITE(update_log)

BOOST_AUTO_TEST_CASE(lines_are_numbered_from_1) {
    cles::core::update_log log;
    BOOST_TEST(log.last() == 0U);
    append(log, "one");
    BOOST_TEST(log.first() == 1U);
    BOOST_TEST(log.last() == 1U);
    append(log, "two");
    BOOST_TEST(log.last() == 2U);
    BOOST_TEST(log.lines(1, 1) == "one\n");
    BOOST_TEST(log.lines(2, 2) == "two\n");
}

BOOST_AUTO_TEST_CASE(several_lines_are_contiguous) {
    cles::core::update_log log;
    append(log, "one");
    append(log, "");
    append(log, "three");
    BOOST_TEST(log.lines(1, 3) == "one\n\nthree\n");
    BOOST_TEST(log.lines(2, 3) == "\nthree\n");
    BOOST_TEST(log.bytes(1, 2) == 5U);
    BOOST_TEST(log.lines(3, 2).empty());
}

BOOST_AUTO_TEST_CASE(a_line_that_is_rolled_back_leaves_nothing) {
    cles::core::update_log log;
    append(log, "one");
    log.begin().append("half a li");
    BOOST_TEST(log.pending() == "half a li");
    log.roll_back();
    BOOST_TEST(log.last() == 1U);
    append(log, "two");
    BOOST_TEST(log.lines(1, 2) == "one\ntwo\n");
}

BOOST_AUTO_TEST_CASE(the_newest_line_is_never_forgotten) {
    cles::core::update_log log;
    log.forget_before(5);
    BOOST_TEST(log.last() == 0U);
    append(log, "one");
    append(log, "two");
    log.forget_before(100);
    BOOST_TEST(log.first() == 2U);
    BOOST_TEST(log.lines(2, 2) == "two\n");
    log.forget_before(1); // going back has no effect
    BOOST_TEST(log.first() == 2U);
}

BOOST_AUTO_TEST_CASE(it_behaves_like_a_queue_of_lines) {
    cles::core::update_log log;
    std::deque<std::string> model;
    std::uint64_t first = 1;
    std::mt19937 random{11};
    for (int i = 0; i < 20'000; ++i) {
        switch (random() % 4) {
        case 0:
        case 1: {
            const std::string line(random() % 200, static_cast<char>('a' + i % 26));
            append(log, line);
            model.push_back(line + "\n");
            break;
        }
        case 2:
            log.begin().append("taken back");
            log.roll_back();
            break;
        default:
            if (!model.empty()) {
                const auto count = random() % model.size();
                log.forget_before(first + count);
                model.erase(model.begin(), model.begin() + static_cast<std::ptrdiff_t>(count));
                first += count;
            }
        }
        BOOST_REQUIRE_EQUAL(log.first(), first);
        BOOST_REQUIRE_EQUAL(log.last(), first + model.size() - 1);
        if (!model.empty()) {
            const auto from = random() % model.size();
            const auto to = from + random() % (model.size() - from);
            std::string expected;
            for (auto k = from; k <= to; ++k) {
                expected += model[k];
            }
            BOOST_REQUIRE(log.lines(first + from, first + to) == expected);
        }
    }
}

BOOST_AUTO_TEST_CASE(forgotten_lines_release_their_memory) {
    cles::core::update_log log;
    const std::string line(1000, 'x');
    for (int i = 0; i < 5000; ++i) {
        append(log, line);
    }
    log.forget_before(log.last());
    for (int i = 0; i < 200; ++i) {
        append(log, line);
        log.forget_before(log.last());
    }
    BOOST_TEST(log.begin().capacity() < 1'000'000U);
    log.roll_back();
}

BOOST_AUTO_TEST_SUITE_END()
