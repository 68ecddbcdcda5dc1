// SPDX-License-Identifier: BSL-1.0
#include "node/publish/feed_mailbox.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace feed_queue {
namespace {

using cles::feed_event;
using cles::core::feed_queue;
using cles::detail::raw_event;

std::string text_of(const raw_event& e) {
    switch (e.kind) {
    case feed_event::current: return "current " + std::string{e.body};
    case feed_event::update: return std::string{e.publisher} + " " + std::to_string(e.seq) + " " + std::string{e.body};
    case feed_event::gap: return "gap " + std::to_string(e.missed);
    case feed_event::lost: return "lost " + std::string{e.text};
    case feed_event::rebound: return "rebound";
    }
    return "?";
}

std::string pop(feed_queue& queue) {
    std::string text;
    queue.pop([&](const raw_event& e) { text = text_of(e); });
    return text;
}

std::string pop_all(feed_queue& queue) {
    std::string all;
    while (!queue.empty()) {
        all.append(all.empty() ? "" : ", ").append(pop(queue));
    }
    return all;
}

void push_update(feed_queue& queue, std::uint64_t seq, std::string_view body = "{}") {
    queue.push({.kind = feed_event::update, .body = body, .publisher = "car1", .seq = seq});
}

} // namespace
} // namespace feed_queue

BOOST_AUTO_TEST_SUITE(feed_queue)

BOOST_AUTO_TEST_CASE(events_come_out_as_they_went_in) {
    cles::core::feed_queue queue{10, 1000};
    BOOST_TEST(queue.empty());
    {
        const std::string body = "{\"v\":1}"; // destroyed afterwards: the queue keeps a copy
        queue.push({.kind = feed_event::current, .body = body});
        push_update(queue, 17, body);
        queue.push({.kind = feed_event::gap, .missed = 2});
        queue.push({.kind = feed_event::lost, .text = "reset"});
        queue.push({.kind = feed_event::rebound});
    }
    BOOST_TEST(pop_all(queue) == "current {\"v\":1}, car1 17 {\"v\":1}, gap 2, lost reset, rebound");
}

BOOST_AUTO_TEST_CASE(beyond_its_count_the_oldest_are_dropped_as_a_gap) {
    cles::core::feed_queue queue{3, 1000};
    for (std::uint64_t seq = 1; seq <= 5; ++seq) {
        push_update(queue, seq);
    }
    BOOST_TEST(pop_all(queue) == "gap 2, car1 3 {}, car1 4 {}, car1 5 {}");
}

BOOST_AUTO_TEST_CASE(beyond_its_bytes_the_oldest_are_dropped_but_never_the_newest) {
    cles::core::feed_queue queue{100, 10};
    push_update(queue, 1, "[11111]");
    push_update(queue, 2, "[22222]");
    BOOST_TEST(pop_all(queue) == "gap 1, car1 2 [22222]");
    push_update(queue, 3, "[\"longer than all bytes allowed\"]");
    BOOST_TEST(pop_all(queue) == "car1 3 [\"longer than all bytes allowed\"]");
}

BOOST_AUTO_TEST_CASE(fetching_frees_capacity) {
    cles::core::feed_queue queue{2, 1000};
    push_update(queue, 1);
    push_update(queue, 2);
    BOOST_TEST(pop(queue) == "car1 1 {}");
    push_update(queue, 3);
    BOOST_TEST(pop_all(queue) == "car1 2 {}, car1 3 {}");
}

BOOST_AUTO_TEST_CASE(queued_gaps_are_added_up_when_the_next_update_is_dropped) {
    cles::core::feed_queue queue{2, 1000};
    push_update(queue, 1);
    queue.push({.kind = feed_event::gap, .missed = 10});
    push_update(queue, 12);
    push_update(queue, 13);
    push_update(queue, 14);
    BOOST_TEST(pop_all(queue) == "gap 12, car1 13 {}, car1 14 {}"); // 1, 2 to 11, 12
}

BOOST_AUTO_TEST_CASE(a_current_value_is_dropped_without_a_gap) {
    cles::core::feed_queue queue{2, 1000};
    queue.push({.kind = feed_event::current});
    push_update(queue, 8);
    push_update(queue, 9);
    BOOST_TEST(pop_all(queue) == "car1 8 {}, car1 9 {}"); // no update was missed
    queue.push({.kind = feed_event::current});
    push_update(queue, 10);
    push_update(queue, 11);
    push_update(queue, 12);
    BOOST_TEST(pop_all(queue) == "gap 1, car1 11 {}, car1 12 {}");
}

BOOST_AUTO_TEST_CASE(it_stays_bounded) {
    cles::core::feed_queue queue{8, 1000};
    std::uint64_t seq = 0;
    for (int i = 0; i < 10'000; ++i) {
        queue.push({.kind = feed_event::gap, .missed = 1});
        push_update(queue, seq += 2);
        queue.push({.kind = feed_event::lost, .text = "reset"});
        queue.push({.kind = feed_event::rebound});
        queue.push({.kind = feed_event::current});
    }
    std::size_t left = 0;
    std::string last;
    while (!queue.empty()) {
        last = pop(queue);
        ++left;
    }
    BOOST_TEST(left < 100U);
    BOOST_TEST(last == "current {}");
}

BOOST_AUTO_TEST_CASE(a_loss_is_reported_even_to_a_slow_caller) {
    cles::core::feed_queue queue{2, 1000};
    push_update(queue, 1);
    queue.push({.kind = feed_event::lost, .text = "reset"});
    queue.push({.kind = feed_event::rebound});
    for (std::uint64_t seq = 2; seq <= 10; ++seq) {
        push_update(queue, seq);
    }
    const auto all = pop_all(queue);
    BOOST_TEST(all.find("lost reset, rebound") != std::string::npos, all);
    BOOST_TEST(all.ends_with("car1 9 {}, car1 10 {}"), all);
}

BOOST_AUTO_TEST_CASE(of_many_losses_the_oldest_are_dropped_and_values_keep_their_places) {
    cles::core::feed_queue queue{10, 1000};
    push_update(queue, 1);
    std::string expected = "car1 1 {}";
    for (int i = 1; i <= 18; ++i) {
        const auto why = std::to_string(i);
        queue.push({.kind = feed_event::lost, .text = why});
        expected += i <= 2 ? "" : ", lost " + why;
    }
    push_update(queue, 2);
    BOOST_TEST(pop_all(queue) == expected + ", car1 2 {}");
}

BOOST_AUTO_TEST_CASE(a_delivery_may_push_and_pop) {
    cles::core::feed_queue queue{10, 1000};
    push_update(queue, 1);
    push_update(queue, 2);
    std::string seen;
    queue.pop([&](const raw_event& outer) {
        push_update(queue, 3);
        seen = pop_all(queue);
        BOOST_TEST(text_of(outer) == "car1 1 {}"); // unchanged
    });
    BOOST_TEST(seen == "car1 2 {}, car1 3 {}");
    BOOST_TEST(queue.empty());
}

BOOST_AUTO_TEST_SUITE_END()
