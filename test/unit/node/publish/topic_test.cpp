// SPDX-License-Identifier: BSL-1.0
#include "node/publish/topic.hpp"
#include "support/manual_clock.hpp"
#include "support/recording_subscriber.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace topic {
namespace {

using namespace std::chrono_literals;
using cles::test::recording_subscriber;

struct fixture {
    explicit fixture(std::size_t binding_bytes = 4U << 20U) : speed({deadlines, counts, binding_bytes}, "speed") {}

    void publish(std::string_view body) {
        speed.begin().append("head ").append(body);
        speed.commit(5);
    }
    /// Publishes each as `[n]`, without sending it to subscribers.
    void publish(std::uint64_t from, std::uint64_t to) {
        for (auto n = from; n <= to; ++n) {
            publish("[" + std::to_string(n) + "]");
        }
    }
    void drain() { speed.drain(clock.now()); }
    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::counters counts;
    cles::core::topic speed;
};

// "head [3]\nhead [4]\n" as "3 4".
std::string numbers(std::string text) {
    std::string out;
    for (const auto c : text) {
        if (c >= '0' && c <= '9') {
            out += c;
        } else if (c == '\n') {
            out += ' ';
        }
    }
    if (!out.empty()) {
        out.pop_back();
    }
    return out;
}

} // namespace
} // namespace topic

BOOST_FIXTURE_TEST_SUITE(topic, fixture)

BOOST_AUTO_TEST_CASE(there_is_no_last_body_before_the_first_update) {
    BOOST_TEST(speed.last_body().empty());
    BOOST_TEST(speed.seq() == 0U);
}

BOOST_AUTO_TEST_CASE(the_last_body_is_that_of_the_last_update) {
    publish("{\"v\":1}");
    publish("{\"v\":2}");
    BOOST_TEST(speed.last_body() == "{\"v\":2}");
    BOOST_TEST(speed.seq() == 2U);
}

BOOST_AUTO_TEST_CASE(a_subscriber_gets_what_is_published_after_it_was_bound) {
    recording_subscriber b;
    publish(1, 2);
    speed.bind(b, {});
    drain();
    BOOST_TEST(b.take().empty());
    publish(3, 5);
    drain();
    BOOST_TEST(numbers(b.take()) == "3 4 5");
    BOOST_TEST(b.puts == 1U); // in one piece
    BOOST_TEST(counts.updates_delivered == 3U);
    drain();
    BOOST_TEST(b.take().empty());
}

BOOST_AUTO_TEST_CASE(every_subscriber_gets_every_update) {
    recording_subscriber binders[3];
    for (auto& b : binders) {
        speed.bind(b, {});
    }
    publish(1, 2);
    drain();
    for (auto& b : binders) {
        BOOST_TEST(numbers(b.take()) == "1 2");
    }
    BOOST_TEST(counts.updates_published == 2U);
    BOOST_TEST(counts.updates_delivered == 6U);
}

BOOST_AUTO_TEST_CASE(an_unbound_subscriber_gets_nothing_more) {
    recording_subscriber b;
    speed.bind(b, {});
    publish(1, 1);
    BOOST_TEST(speed.unbind(b));
    BOOST_TEST(!speed.is_bound());
    drain();
    BOOST_TEST(b.take().empty());
    BOOST_TEST(!speed.unbind(b));
}

BOOST_AUTO_TEST_CASE(binding_again_replaces_the_binding) {
    recording_subscriber b;
    speed.bind(b, {});
    speed.bind(b, {.keep = 2});
    publish(1, 1);
    drain();
    BOOST_TEST(numbers(b.take()) == "1"); // once
    b.capacity = 0;
    publish(2, 6);
    drain();
    b.capacity = 100;
    drain();
    BOOST_TEST(numbers(b.take()) == "5 6");
    BOOST_TEST(speed.unbind(b));
    BOOST_TEST(!speed.is_bound());
}

BOOST_AUTO_TEST_SUITE(slow_binders)

BOOST_AUTO_TEST_CASE(a_slow_subscriber_gets_pending_updates_later) {
    recording_subscriber b;
    speed.bind(b, {});
    b.capacity = 0;
    publish(1, 3);
    drain();
    BOOST_TEST(b.take().empty());
    b.capacity = 100;
    speed.find(b)->drain(clock.now());
    BOOST_TEST(numbers(b.take()) == "1 2 3");
    BOOST_TEST(counts.updates_shed == 0U);
}

BOOST_AUTO_TEST_CASE(beyond_keep_the_oldest_is_dropped_and_the_newest_is_sent) {
    recording_subscriber b;
    speed.bind(b, {.keep = 3});
    b.capacity = 0;
    for (std::uint64_t n = 1; n <= 10; ++n) {
        publish(n, n);
        drain();
    }
    b.capacity = 100;
    drain();
    BOOST_TEST(numbers(b.take()) == "8 9 10");
    BOOST_TEST(counts.updates_shed == 7U);
    BOOST_TEST(counts.updates_delivered == 3U);
}

BOOST_AUTO_TEST_CASE(keep_applies_to_bursts_too) {
    recording_subscriber b;
    speed.bind(b, {.keep = 3});
    b.capacity = 0;
    publish(1, 10);
    drain();
    b.capacity = 100;
    drain();
    BOOST_TEST(numbers(b.take()) == "8 9 10");
}

BOOST_AUTO_TEST_CASE(keep_is_64_by_default) {
    recording_subscriber b;
    speed.bind(b, {});
    b.capacity = 0;
    publish(1, 65);
    drain();
    b.capacity = 100;
    drain();
    const auto got = numbers(b.take());
    BOOST_TEST(got.starts_with("2 3 "), got);
    BOOST_TEST(got.ends_with(" 65"), got);
}

BOOST_AUTO_TEST_CASE(a_keep_of_1_holds_only_the_newest) {
    recording_subscriber b;
    speed.bind(b, {.keep = 1});
    b.capacity = 0;
    publish(1, 3);
    drain();
    publish(4, 4);
    b.capacity = 1;
    drain();
    BOOST_TEST(numbers(b.take()) == "4");
}

BOOST_AUTO_TEST_CASE(each_subscriber_has_its_own_keep) {
    recording_subscriber little;
    recording_subscriber much;
    speed.bind(little, {.keep = 2});
    speed.bind(much, {.keep = 5});
    little.capacity = much.capacity = 0;
    for (std::uint64_t n = 1; n <= 9; ++n) {
        publish(n, n);
        drain();
    }
    little.capacity = much.capacity = 10;
    drain();
    BOOST_TEST(numbers(little.take()) == "8 9");
    BOOST_TEST(numbers(much.take()) == "5 6 7 8 9");
}

BOOST_AUTO_TEST_CASE(a_slow_subscriber_does_not_affect_others) {
    recording_subscriber slow;
    recording_subscriber quick;
    speed.bind(slow, {.keep = 2});
    speed.bind(quick, {.keep = 2});
    slow.capacity = 0;
    std::string got;
    for (std::uint64_t n = 1; n <= 9; ++n) {
        publish(n, n);
        drain();
        got += numbers(quick.take());
    }
    BOOST_TEST(got == "123456789");
    slow.capacity = 1;
    drain();
    BOOST_TEST(numbers(slow.take()) == "8 9");
}

BOOST_AUTO_TEST_CASE(the_bytes_that_a_binding_queues_are_limited) {
    fixture small{2500};
    recording_subscriber b;
    small.speed.bind(b, {.keep = 65'536});
    b.capacity = 0;
    for (int i = 0; i < 9; ++i) {
        small.publish(std::string(994, static_cast<char>('0' + i))); // 1000 bytes per line
        small.drain();
    }
    b.capacity = 100;
    small.drain();
    const auto got = b.take();
    BOOST_TEST(got.size() == 2000U);
    BOOST_TEST(got.find('7') != std::string::npos);
    BOOST_TEST(got.find('8') != std::string::npos);
    BOOST_TEST(small.counts.updates_shed == 7U);
}

BOOST_AUTO_TEST_CASE(the_newest_is_sent_even_if_it_is_larger_than_the_queue) {
    fixture small{2500};
    recording_subscriber b;
    small.speed.bind(b, {});
    b.capacity = 0;
    small.publish(1, 3);
    small.publish(std::string(5000, '4'));
    small.drain();
    b.capacity = 100;
    small.drain();
    BOOST_TEST(b.take().size() == 5006U);
}

BOOST_AUTO_TEST_CASE(large_output_is_sent_in_pieces_so_that_a_subscriber_can_stop_it) {
    recording_subscriber b;
    speed.bind(b, {.keep = 1000});
    b.capacity = 0;
    for (int i = 0; i < 400; ++i) {
        publish(std::string(1000, 'x'));
    }
    b.capacity = 1;
    drain();
    const auto piece = b.take().size();
    BOOST_TEST(piece > 1000U);
    BOOST_TEST(piece <= 65'536U);
    b.capacity = 1000;
    drain();
    BOOST_TEST(piece + b.take().size() == 400U * 1006U);
}

BOOST_AUTO_TEST_CASE(no_update_is_lost_or_repeated_while_its_number_is_within_keep) {
    std::mt19937 random{17};
    std::vector<recording_subscriber> binders(5);
    std::vector<std::string> got(binders.size());
    for (auto& b : binders) {
        speed.bind(b, {.keep = 50});
    }
    std::string expected;
    std::uint64_t n = 0;
    for (int i = 0; i < 2000; ++i) {
        const auto more = random() % 10;
        publish(n + 1, n + more);
        for (std::uint64_t k = n + 1; k <= n + more; ++k) {
            expected += "head [" + std::to_string(k) + "]\n";
        }
        n += more;
        for (auto& b : binders) {
            b.capacity = i % 4 == 3 ? 1000 : random() % 2; // catches up within 40 updates
        }
        drain();
        for (std::size_t k = 0; k < binders.size(); ++k) {
            got[k] += binders[k].take();
        }
    }
    for (const auto& g : got) {
        BOOST_TEST((g == expected));
    }
    BOOST_TEST(counts.updates_shed == 0U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(every)

BOOST_AUTO_TEST_CASE(with_every_the_first_is_sent_at_once_then_the_newest_per_interval) {
    recording_subscriber b;
    speed.bind(b, {.every = 100ms});
    publish(1, 1);
    drain();
    BOOST_TEST(numbers(b.take()) == "1");
    publish(2, 2);
    drain();
    pass(50ms);
    publish(3, 4);
    drain();
    BOOST_TEST(b.take().empty());
    pass(49ms);
    BOOST_TEST(b.take().empty());
    pass(1ms);
    BOOST_TEST(numbers(b.take()) == "4");
}

BOOST_AUTO_TEST_CASE(the_interval_counts_from_the_last_update_that_was_sent) {
    recording_subscriber b;
    speed.bind(b, {.every = 100ms});
    publish(1, 1);
    drain();
    b.take();
    pass(250ms); // nothing was published meanwhile
    publish(2, 2);
    drain();
    BOOST_TEST(numbers(b.take()) == "2");
    pass(99ms);
    publish(3, 3);
    drain();
    BOOST_TEST(b.take().empty());
    pass(1ms);
    BOOST_TEST(numbers(b.take()) == "3");
    pass(1h);
    BOOST_TEST(b.take().empty()); // there is nothing new to send
}

BOOST_AUTO_TEST_CASE(a_slow_subscriber_gets_the_newest_when_it_takes_it) {
    recording_subscriber b;
    speed.bind(b, {.every = 100ms});
    b.capacity = 0;
    publish(1, 5);
    drain();
    pass(1h);
    BOOST_TEST(b.take().empty());
    b.capacity = 10;
    speed.find(b)->drain(clock.now());
    BOOST_TEST(numbers(b.take()) == "5");
}

BOOST_AUTO_TEST_CASE(each_subscriber_has_its_own_interval) {
    recording_subscriber all;
    recording_subscriber slow;
    recording_subscriber slower;
    speed.bind(all, {});
    speed.bind(slow, {.every = 100ms});
    speed.bind(slower, {.every = 250ms});
    std::string got_all;
    std::string got_slow;
    std::string got_slower;
    for (std::uint64_t n = 1; n <= 9; ++n) {
        publish(n, n);
        drain();
        pass(50ms);
        got_all += numbers(all.take());
        got_slow += numbers(slow.take());
        got_slower += numbers(slower.take());
    }
    BOOST_TEST(got_all == "123456789");
    BOOST_TEST(got_slow == "12468"); // at 0, then the newest at 100, 200, 300, 400
    BOOST_TEST(got_slower == "15");
}

BOOST_AUTO_TEST_CASE(unbinding_cancels_later_updates) {
    recording_subscriber b;
    speed.bind(b, {.every = 100ms});
    publish(1, 1);
    drain();
    b.take();
    publish(2, 2);
    drain();
    speed.unbind(b);
    pass(1h);
    BOOST_TEST(b.take().empty());
    BOOST_TEST(deadlines.size() == 0U);
}

BOOST_AUTO_TEST_CASE(binding_again_without_every_ends_the_thinning) {
    recording_subscriber b;
    speed.bind(b, {.every = 100ms});
    publish(1, 1);
    drain();
    publish(2, 4);
    drain();
    BOOST_TEST(numbers(b.take()) == "1");
    speed.bind(b, {}); // its reply is update 4, so nothing before it may follow
    publish(5, 6);
    drain();
    BOOST_TEST(numbers(b.take()) == "5 6");
    BOOST_TEST(counts.updates_shed == 0U);
    pass(1h);
    BOOST_TEST(b.take().empty());
}

BOOST_AUTO_TEST_CASE(binding_again_with_every_takes_effect_at_once) {
    recording_subscriber b;
    speed.bind(b, {.every = 10s});
    publish(1, 1);
    drain();
    b.take();
    speed.bind(b, {.every = 100ms});
    publish(2, 2);
    drain();
    BOOST_TEST(numbers(b.take()) == "2");
    publish(3, 3);
    drain();
    pass(100ms);
    BOOST_TEST(numbers(b.take()) == "3");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(capacity)

BOOST_AUTO_TEST_CASE(there_is_capacity_if_no_subscriber_needs_every_update) {
    BOOST_TEST(speed.has_capacity());
    recording_subscriber b;
    b.capacity = 0;
    speed.bind(b, {.every = 100ms, .keep = 1});
    publish(1, 10);
    drain();
    BOOST_TEST(speed.has_capacity());
}

BOOST_AUTO_TEST_CASE(there_is_capacity_until_the_slowest_queue_is_full) {
    recording_subscriber quick;
    recording_subscriber slow;
    speed.bind(quick, {.keep = 100});
    speed.bind(slow, {.keep = 3});
    slow.capacity = 0;
    for (std::uint64_t n = 1; n <= 3; ++n) {
        BOOST_TEST(speed.has_capacity());
        publish(n, n);
        drain();
    }
    BOOST_TEST(!speed.has_capacity());
    slow.capacity = 10;
    drain();
    BOOST_TEST(speed.has_capacity());
    BOOST_TEST(numbers(slow.take()) == "1 2 3");
}

BOOST_AUTO_TEST_CASE(there_is_no_capacity_if_the_bytes_do_not_fit) {
    fixture small{4000};
    recording_subscriber b;
    small.speed.bind(b, {.keep = 1000});
    b.capacity = 0;
    small.publish(std::string(2000, 'x'));
    small.drain();
    BOOST_TEST(!small.speed.has_capacity());
    b.capacity = 10;
    small.drain();
    BOOST_TEST(small.speed.has_capacity());
}

BOOST_AUTO_TEST_CASE(unbinding_the_slow_subscriber_frees_capacity) {
    recording_subscriber slow;
    speed.bind(slow, {.keep = 1});
    slow.capacity = 0;
    publish(1, 1);
    drain();
    BOOST_TEST(!speed.has_capacity());
    speed.unbind(slow);
    BOOST_TEST(speed.has_capacity());
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
