// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <ostream>
#include <string>

namespace cles::core {

std::ostream& operator<<(std::ostream& out, dedup::verdict v) {
    switch (v) {
    case dedup::verdict::fresh: return out << "fresh";
    case dedup::verdict::running: return out << "running";
    case dedup::verdict::answered: return out << "answered";
    case dedup::verdict::clash: return out << "clash";
    }
    return out;
}

} // namespace cles::core

namespace dedup {
namespace {

using namespace std::chrono_literals;
using verdict = cles::core::dedup::verdict;

struct fixture {
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }
    void answer(std::uint64_t id, std::string_view reply) { seen->set_reply(id, reply, clock.now()); }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::dedup_memory memory{.limit = 15000};
    std::unique_ptr<cles::core::dedup> seen = std::make_unique<cles::core::dedup>(deadlines, memory);
};

} // namespace
} // namespace dedup

BOOST_FIXTURE_TEST_SUITE(dedup, fixture)

BOOST_AUTO_TEST_CASE(a_request_is_fresh_once_then_runs_then_has_its_reply) {
    BOOST_TEST(seen->look(7, "PUSH a:b id=7") == verdict::fresh);
    BOOST_TEST(seen->begin(7, "PUSH a:b id=7", 1200));
    BOOST_TEST(seen->look(7, "PUSH a:b id=7") == verdict::running);
    answer(7, "id=7 {}\n");
    BOOST_TEST(seen->look(7, "PUSH a:b id=7") == verdict::answered);
    BOOST_TEST(seen->reply(7, "PUSH a:b id=7") == "id=7 {}\n");
}

BOOST_AUTO_TEST_CASE(a_running_request_is_remembered_however_long_it_takes) {
    seen->begin(7, "x", 10);
    pass(24h);
    BOOST_TEST(seen->look(7, "x") == verdict::running);
}

BOOST_AUTO_TEST_CASE(a_reply_is_remembered_for_60_s) {
    seen->begin(7, "x", 10);
    pass(5s);
    answer(7, "r");
    pass(59'999ms);
    BOOST_TEST(seen->look(7, "x") == verdict::answered);
    pass(1ms);
    BOOST_TEST(seen->look(7, "x") == verdict::fresh);
    BOOST_TEST(seen->empty());
    BOOST_TEST(memory.used == 0U);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(each_is_forgotten_at_its_own_time) {
    for (std::uint64_t id = 1; id <= 3; ++id) {
        seen->begin(id, "x", 10);
    }
    answer(2, "two");
    pass(10s);
    answer(1, "one");
    pass(50s);
    BOOST_TEST(seen->look(2, "x") == verdict::fresh);
    BOOST_TEST(seen->look(1, "x") == verdict::answered);
    BOOST_TEST(seen->look(3, "x") == verdict::running);
    pass(10s);
    BOOST_TEST(seen->look(1, "x") == verdict::fresh);
}

BOOST_AUTO_TEST_CASE(other_bytes_with_a_running_id_clash) {
    seen->begin(7, "x", 10);
    BOOST_TEST(seen->look(7, "y") == verdict::clash);
    BOOST_TEST(seen->look(8, "x") == verdict::fresh);
}

BOOST_AUTO_TEST_CASE(other_bytes_with_an_answered_id_are_a_new_request) {
    seen->begin(7, "x", 10);
    answer(7, "rx");
    BOOST_TEST(seen->look(7, "y") == verdict::fresh);
    seen->begin(7, "y", 10);
    BOOST_TEST(seen->look(7, "x") == verdict::answered);
    answer(7, "ry");
    BOOST_TEST(seen->reply(7, "x") == "rx");
    BOOST_TEST(seen->reply(7, "y") == "ry");
}

BOOST_AUTO_TEST_CASE(a_repeatable_request_is_forgotten_with_its_reply) {
    seen->add_repeatable(7, "PULL a:b id=7");
    BOOST_TEST(seen->look(7, "PULL a:b id=7") == verdict::running);
    answer(7, "id=7 {}\n");
    BOOST_TEST(seen->empty());
    BOOST_TEST(memory.used == 0U);
}

BOOST_AUTO_TEST_CASE(a_reply_to_no_request_is_ignored) {
    answer(7, "r");
    BOOST_TEST(seen->empty());
    seen->begin(7, "x", 10);
    answer(7, "first");
    answer(7, "second");
    BOOST_TEST(seen->reply(7, "x") == "first");
}

BOOST_AUTO_TEST_CASE(beyond_the_common_limit_new_requests_are_refused) {
    cles::core::dedup other{deadlines, memory};
    const std::string bytes(1000, 'x');
    std::uint64_t taken = 0;
    while ((taken % 2 == 0 ? *seen : other).begin(taken, bytes, 1200)) {
        ++taken;
        BOOST_TEST(memory.used <= memory.limit);
    }
    BOOST_TEST(taken == 6U);
    BOOST_TEST(!other.begin(100, "y", 1200));
    // Short replies need less memory than was reserved for them.
    for (std::uint64_t id = 0; id < taken; ++id) {
        answer(id, "r");
        other.set_reply(id, "r", clock.now());
    }
    BOOST_TEST(other.begin(100, "y", 1200));
    BOOST_TEST(memory.used <= memory.limit);
}

BOOST_AUTO_TEST_CASE(destroying_a_source_releases_its_memory) {
    seen->begin(1, "x", 10);
    seen->begin(2, "x", 10);
    answer(2, "r");
    BOOST_TEST(memory.used != 0U);
    seen.reset();
    BOOST_TEST(memory.used == 0U);
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()
