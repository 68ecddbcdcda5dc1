// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/flush_scheduler.hpp"
#include "node/publish/publications.hpp"
#include "support/manual_clock.hpp"
#include "support/recorded_reply.hpp"
#include "support/recording_subscriber.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace publications {
namespace {

using cles::errc;
using cles::json_writer;
using cles::test::outcome;
using cles::test::recording_subscriber;

struct fixture {
    explicit fixture(cles::limits wanted = {})
        : bounds(wanted),
          all({deadlines, counts, bounds.binding_bytes}, bounds, completions, "car1", "5f3a09c1", unsent) {}

    void bind(recording_subscriber& b, std::string_view path, std::uint32_t keep = 64) {
        all.open(path).bind(b, {.keep = keep});
    }
    void drain() {
        cles::core::send_updates(unsent, all, clock.now());
        tell();
    }
    void tell() {
        for (; !due.empty(); due.pop_front()) {
            due.front()();
        }
    }
    /// Publishes at once, and returns null, or when there is capacity.
    std::shared_ptr<outcome> publish_or_wait(std::string_view path, std::string_view body) {
        auto [operation, result] = cles::test::record();
        return all.publish_or_wait(path, body, operation) ? nullptr : result;
    }

    cles::test::manual_clock clock;
    cles::core::deadline_queue deadlines;
    cles::core::counters counts;
    cles::limits bounds;
    int wakes = 0;
    std::deque<cles::core::completion> due;
    cles::core::completion_queue completions{[this](cles::core::completion c) { due.push_back(std::move(c)); }};
    cles::core::unsent_topics unsent{[this] { ++wakes; }};
    cles::core::publications all;
};

bool is_busy(const cles::error& e) { return e.code() == errc::busy; }
bool is_too_large(const cles::error& e) { return e.code() == errc::too_large; }
bool is_failed(const cles::error& e) { return e.code() == errc::failed; }

} // namespace
} // namespace publications

BOOST_FIXTURE_TEST_SUITE(publications, fixture)

BOOST_AUTO_TEST_CASE(an_update_has_publisher_noun_seq_and_epoch) {
    recording_subscriber b;
    bind(b, "localization/fast");
    all.publish_body("localization/fast", "{\"utc\":1}");
    all.publish_body("localization/fast", "{\"utc\":2}");
    drain();
    BOOST_TEST(b.take() == "UPDATE car1:localization/fast seq=1 epoch=5f3a09c1 {\"utc\":1}\n"
                           "UPDATE car1:localization/fast seq=2 epoch=5f3a09c1 {\"utc\":2}\n");
}

BOOST_AUTO_TEST_CASE(seq_counts_each_nouns_publications_from_1_even_without_subscribers) {
    all.publish_body("speed", "{}");
    all.publish_body("speed", "{}");
    all.publish_body("speed/left", "{}");
    recording_subscriber b;
    bind(b, "speed");
    bind(b, "speed/left");
    all.publish_body("speed", "[]");
    all.publish_body("speed/left", "[]");
    drain();
    BOOST_TEST(b.take() == "UPDATE car1:speed seq=3 epoch=5f3a09c1 []\n"
                           "UPDATE car1:speed/left seq=2 epoch=5f3a09c1 []\n");
}

BOOST_AUTO_TEST_CASE(parameters_belong_to_the_noun) {
    recording_subscriber b;
    bind(b, "speed/left");
    all.publish_body("speed", "{}");
    all.publish_body("speed/right", "{}");
    drain();
    BOOST_TEST(b.take().empty());
}

BOOST_AUTO_TEST_CASE(a_scalar_is_published_wrapped_and_nothing_as_an_empty_object) {
    all.publish("speed", [](json_writer& w) { w.value(2.5); });
    BOOST_TEST(all.find("speed")->last_body() == "{\"value\":2.5}");
    all.publish("speed", [](json_writer&) {});
    BOOST_TEST(all.find("speed")->last_body() == "{}");
    all.publish("speed", [](json_writer& w) { w.value(std::string_view{"{}"}); });
    BOOST_TEST(all.find("speed")->last_body() == "{\"value\":\"{}\"}");
}

BOOST_AUTO_TEST_CASE(an_update_longer_than_a_line_is_refused_and_leaves_no_trace) {
    fixture small{cles::limits{.line = 100}};
    small.all.publish_body("speed", "[1]");
    BOOST_CHECK_EXCEPTION(small.all.publish_body("speed", "[\"" + std::string(100, 'x') + "\"]"), cles::error,
                          is_too_large);
    BOOST_TEST(small.all.find("speed")->last_body() == "[1]");
    BOOST_TEST(small.all.find("speed")->seq() == 1U);
    BOOST_CHECK_EXCEPTION(small.all.publish_body("other", "[\"" + std::string(100, 'x') + "\"]"), cles::error,
                          is_too_large);
    BOOST_TEST(!small.all.knows("other"));
}

BOOST_AUTO_TEST_CASE(an_update_of_exactly_the_limit_is_published) {
    const std::string head = "UPDATE car1:speed seq=1 epoch=5f3a09c1 ";
    fixture small{cles::limits{.line = head.size() + 10}};
    BOOST_CHECK_EXCEPTION(small.all.publish_body("speed", "[12345678.]"), cles::error, is_too_large);
    small.all.publish_body("speed", "[12345678]");
    BOOST_TEST(small.all.find("speed")->seq() == 1U);
}

BOOST_AUTO_TEST_CASE(an_update_whose_first_key_is_error_is_refused) {
    BOOST_CHECK_EXCEPTION(all.publish_body("speed", "{\"error\":1}"), cles::error, is_failed);
    BOOST_TEST(all.find("speed") == nullptr);
    all.publish_body("speed", "{\"a\":1,\"error\":1}");
    BOOST_TEST(all.find("speed")->seq() == 1U);
}

BOOST_AUTO_TEST_CASE(a_writer_that_throws_publishes_nothing) {
    all.publish_body("speed", "[1]");
    BOOST_CHECK_THROW(all.publish("speed",
                                  [](json_writer& w) {
                                      w.value(1.5);
                                      throw std::runtime_error{"sensor"};
                                  }),
                      std::runtime_error);
    BOOST_TEST(all.find("speed")->last_body() == "[1]");
    all.publish_body("speed", "[2]");
    BOOST_TEST(all.find("speed")->last_body() == "[2]");
    BOOST_TEST(all.find("speed")->seq() == 2U);
}

BOOST_AUTO_TEST_CASE(the_number_of_nouns_of_a_task_is_limited) {
    fixture small{cles::limits{.nouns = 3}};
    recording_subscriber b;
    for (const auto* path : {"speed", "speed/a", "speed/b"}) {
        small.bind(b, path);
        small.all.publish_body(path, "{}");
    }
    BOOST_CHECK_EXCEPTION(small.all.publish_body("speed/c", "{}"), cles::error, is_busy);
    BOOST_CHECK_EXCEPTION(small.all.open("speed/c"), cles::error, is_busy);
    small.all.publish_body("speed/a", "[]"); // existing nouns can be published
    small.all.publish_body("load/c", "{}");  // and other tasks
    BOOST_TEST(small.all.find("speed/c") == nullptr);
}

BOOST_AUTO_TEST_CASE(a_noun_that_is_not_needed_is_forgotten) {
    fixture small{cles::limits{.nouns = 1}};
    recording_subscriber b;
    small.bind(b, "speed/a");
    BOOST_TEST(small.all.knows("speed"));
    auto& noun = *small.all.find("speed/a");
    small.all.remove_if_unused(noun);
    BOOST_TEST(small.all.find("speed/a") != nullptr); // it has a subscriber
    noun.unbind(b);
    small.all.remove_if_unused(noun);
    BOOST_TEST(small.all.find("speed/a") == nullptr);
    BOOST_TEST(!small.all.knows("speed"));
    small.all.open("speed/b");
}

BOOST_AUTO_TEST_CASE(a_noun_that_was_published_is_remembered) {
    all.publish_body("speed", "[1]");
    all.remove_if_unused(*all.find("speed"));
    BOOST_TEST(all.find("speed")->last_body() == "[1]");
}

// -- nouns that retire -----------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_new_noun_replaces_the_least_recently_used_one) {
    fixture small{cles::limits{.nouns = 3}};
    for (const auto* path : {"job/1", "job/2", "job/3", "job/1"}) {
        small.all.publish_body(path, "[1]");
    }
    small.all.publish_body("job/4", "[4]");
    BOOST_TEST(small.all.find("job/2") == nullptr);
    BOOST_TEST(small.all.find("job/1") != nullptr);
    small.all.publish_body("job/5", "[5]");
    BOOST_TEST(small.all.find("job/3") == nullptr);
    BOOST_TEST(small.all.find("job/1")->last_body() == "[1]");
    BOOST_TEST(small.counts.nouns_retired == 2U);
}

BOOST_AUTO_TEST_CASE(short_lived_nouns_never_exhaust_the_limit) {
    fixture small{cles::limits{.nouns = 16}};
    for (int i = 0; i < 100'000; ++i) {
        small.all.publish_body("session/" + std::to_string(i), "[1]");
    }
    BOOST_TEST(small.counts.nouns_retired == 100'000U - 16U);
    BOOST_TEST(small.all.find("session/99999") != nullptr);
    BOOST_TEST(small.all.find("session/99983") == nullptr);
}

BOOST_AUTO_TEST_CASE(a_bound_noun_does_not_retire_and_unbinding_counts_as_use) {
    fixture small{cles::limits{.nouns = 2}};
    recording_subscriber b;
    small.all.publish_body("job/1", "[1]");
    small.bind(b, "job/1");
    small.all.publish_body("job/2", "[2]");
    small.all.publish_body("job/3", "[3]"); // replaces 2, although 1 was used before
    BOOST_TEST(small.all.find("job/2") == nullptr);
    small.bind(b, "job/3");
    BOOST_CHECK_EXCEPTION(small.all.publish_body("job/4", "[4]"), cles::error, is_busy);
    BOOST_TEST(!small.all.can_publish("job/4"));
    for (const auto* path : {"job/3", "job/1"}) {
        auto& noun = *small.all.find(path);
        noun.unbind(b);
        small.all.release(noun);
    }
    BOOST_TEST(small.all.can_publish("job/4"));
    small.all.publish_body("job/4", "[4]");
    BOOST_TEST(small.all.find("job/3") == nullptr);
    BOOST_TEST(small.all.find("job/1")->last_body() == "[1]");
}

BOOST_AUTO_TEST_CASE(a_bind_never_makes_a_noun_retire) {
    fixture small{cles::limits{.nouns = 1}};
    small.all.publish_body("job/1", "[1]");
    BOOST_CHECK_EXCEPTION(small.all.open("job/2"), cles::error, is_busy);
    BOOST_TEST(!small.all.can_open("job/2"));
    BOOST_TEST(small.all.can_publish("job/2"));
    BOOST_TEST(small.all.find("job/1")->last_body() == "[1]");
}

BOOST_AUTO_TEST_CASE(a_noun_that_returns_is_numbered_above_all_that_retired) {
    fixture small{cles::limits{.nouns = 2}};
    for (int i = 0; i < 7; ++i) {
        small.all.publish_body("job/1", "[1]");
    }
    small.all.publish_body("job/2", "[2]");
    BOOST_TEST(small.all.find("job/2")->seq() == 1U); // nothing has retired yet
    small.all.publish_body("job/3", "[3]");           // replaces 1
    BOOST_TEST(small.all.find("job/3")->seq() == 8U);
    small.all.publish_body("job/1", "[1]"); // replaces 2
    BOOST_TEST(small.all.find("job/1")->seq() == 8U);
    small.all.publish_body("job/1", "[1]");
    BOOST_TEST(small.all.retire("job/1"));
    small.all.publish_body("job/1", "[1]");
    BOOST_TEST(small.all.find("job/1")->seq() == 10U);
    BOOST_TEST(std::string{small.all.find("job/1")->last_line()}.find(" seq=10 ") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(retiring_forgets_the_value_but_keeps_subscribers) {
    recording_subscriber b;
    bind(b, "job/1");
    b.capacity = 0;
    all.publish_body("job/1", "[1]");
    all.publish_body("job/2", "[2]");
    BOOST_TEST(all.retire("job/1"));
    BOOST_TEST(all.retire("job/2"));
    BOOST_TEST(!all.retire("job/2"));
    BOOST_TEST(!all.retire("job/3"));
    BOOST_TEST(all.find("job/2") == nullptr);
    BOOST_TEST(all.find("job/1")->last_body().empty());
    BOOST_TEST(all.find("job/1")->last_line().empty());
    b.capacity = 100;
    drain();
    BOOST_TEST(b.take().find("seq=1 ") != std::string::npos); // published before the retirement
    all.publish_body("job/1", "[3]");
    drain();
    BOOST_TEST(b.take().find("seq=2 ") != std::string::npos);
    BOOST_TEST(all.find("job/1")->last_body() == "[3]");
    BOOST_TEST(all.knows("job")); // a task that has been published stays open
    BOOST_TEST((all.tasks() == std::set<std::string>{"job"}));
}

BOOST_AUTO_TEST_CASE(all_nouns_of_a_task_retire_together) {
    for (const auto* const noun : {"job", "job/1", "job/2/3", "jobs/1", "jo"}) {
        all.publish_body(noun, "[1]");
    }
    BOOST_TEST(all.retire_all("job") == 3U);
    BOOST_TEST(all.retire_all("job") == 0U);
    BOOST_TEST(all.find("job/2/3") == nullptr);
    BOOST_TEST(all.find("jobs/1")->last_body() == "[1]");
    BOOST_TEST(all.find("jo")->last_body() == "[1]");
}

BOOST_AUTO_TEST_CASE(a_noun_cannot_retire_or_be_published_while_a_value_of_it_is_written) {
    fixture small{cles::limits{.nouns = 2}};
    small.all.publish_body("job/1", "[1]");
    small.all.publish("job/1", [&](json_writer& w) {
        BOOST_TEST(!small.all.retire("job/1"));
        BOOST_CHECK_EXCEPTION(small.all.publish_body("job/1", "[9]"), cles::error, is_failed);
        for (int i = 2; i < 9; ++i) {
            small.all.publish_body("job/" + std::to_string(i), "[9]");
        }
        w.raw("[2]");
    });
    BOOST_TEST(small.all.find("job/1")->last_body() == "[2]");
    BOOST_TEST(small.all.find("job/1")->seq() == 2U);
}

// -- memory ----------------------------------------------------------------------------------------------------------

struct bounded : fixture {
    bounded() {
        all_ = std::make_unique<cles::core::publications>(
            cles::core::topic_context{deadlines, counts, bounds.binding_bytes, values}, bounds, completions, "car1",
            "5f3a09c1", unsent);
    }
    static std::string large(std::size_t bytes) { return "[\"" + std::string(bytes, 'x') + "\"]"; }

    cles::core::memory_budget memory{2'000'000};
    std::shared_ptr<cles::core::memory_account> values = std::make_shared<cles::core::memory_account>(memory);
    std::unique_ptr<cles::core::publications> all_;
};

BOOST_FIXTURE_TEST_CASE(values_past_the_memory_take_the_place_of_those_used_longest_ago, bounded) {
    for (int i = 0; i < 100; ++i) {
        all_->publish_body("map/" + std::to_string(i), large(100'000));
        BOOST_TEST(memory.used() <= memory.limit() / 2);
    }
    BOOST_TEST(counts.nouns_retired > 80U);
    BOOST_TEST(counts.nouns_retired < 97U);
    BOOST_TEST(all_->find("map/99") != nullptr);
    all_.reset();
    BOOST_TEST(memory.used() == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_value_that_stays_takes_little_more_than_its_length, bounded) {
    for (int i = 0; i < 10; ++i) {
        all_->publish_body("map", large(200'000));
    }
    BOOST_TEST(memory.used() < 270'000U);
    all_->publish_body("map", large(100));
    all_->publish_body("map", large(100));
    BOOST_TEST(memory.used() < 10'000U);
    all_->retire("map");
    BOOST_TEST(memory.used() == 0U);
}

BOOST_FIXTURE_TEST_CASE(a_value_for_which_nothing_can_go_is_busy_and_the_one_before_stays, bounded) {
    all_->publish_body("other", large(700'000)); // of another task
    all_->publish_body("map", "[1]");
    BOOST_CHECK_EXCEPTION(all_->publish_body("map", large(700'000)), cles::error, is_busy);
    BOOST_TEST(all_->find("map")->last_body() == "[1]");
    BOOST_TEST(memory.used() < 900'000U);
    all_->publish_body("map", "[2]");
    BOOST_TEST(all_->find("map")->seq() == 2U);
    BOOST_TEST(all_->retire("other"));
    all_->publish_body("map", large(700'000));
}

BOOST_FIXTURE_TEST_CASE(past_the_memory_a_slow_binder_misses_updates_before_a_publisher_is_refused, bounded) {
    recording_subscriber slow;
    slow.capacity = 0;
    all_->open("map").bind(slow, {.keep = 64});
    for (int i = 0; i < 50; ++i) {
        all_->publish_body("map", large(100'000));
        BOOST_TEST(memory.used() <= memory.limit() / 2 + 400'000);
    }
    slow.capacity = 100;
    cles::core::send_updates(unsent, *all_, clock.now());
    BOOST_TEST(counts.updates_shed > 0U);
    BOOST_TEST(slow.take().find(" seq=50 ") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(a_publication_that_waits_is_busy_rather_than_shed, bounded) {
    recording_subscriber slow;
    slow.capacity = 0;
    all_->open("map").bind(slow, {.keep = 64});
    bool refused = false;
    for (int i = 0; i < 50 && !refused; ++i) {
        auto [operation, result] = cles::test::record();
        try {
            all_->publish_or_wait("map", large(100'000), operation);
        } catch (const cles::error& e) {
            refused = is_busy(e);
        }
    }
    BOOST_TEST(refused);
    slow.capacity = 100;
    cles::core::send_updates(unsent, *all_, clock.now());
    BOOST_TEST(counts.updates_shed == 0U);
}

BOOST_AUTO_TEST_CASE(it_requests_a_drain_once) {
    recording_subscriber b;
    all.publish_body("speed", "{}");
    BOOST_TEST(wakes == 0); // no subscriber
    BOOST_TEST(unsent.empty());
    bind(b, "speed");
    bind(b, "load");
    all.publish_body("speed", "{}");
    all.publish_body("speed", "{}");
    all.publish_body("load", "{}");
    BOOST_TEST(wakes == 1);
    BOOST_TEST(!unsent.empty());
    drain();
    BOOST_TEST(unsent.empty());
    all.publish_body("load", "{}");
    BOOST_TEST(wakes == 2);
}

BOOST_AUTO_TEST_CASE(the_tasks_that_were_published_are_known) {
    recording_subscriber b;
    all.publish_body("speed/a", "{}");
    all.publish_body("speed/b", "{}");
    all.publish_body("load", "{}");
    bind(b, "never");
    const std::vector<std::string> expected{"load", "speed"};
    BOOST_TEST(all.tasks() == expected, boost::test_tools::per_element());
    BOOST_TEST(all.knows("speed"));
    BOOST_TEST(!all.knows("speed/a"));
    BOOST_TEST(!all.knows("spee"));
}

BOOST_AUTO_TEST_SUITE(publish_or_wait)

BOOST_AUTO_TEST_CASE(it_publishes_at_once_if_there_is_capacity) {
    BOOST_TEST(publish_or_wait("speed", "[1]") == nullptr);
    BOOST_TEST(all.find("speed")->last_body() == "[1]");
}

// In order with all other completions.
BOOST_AUTO_TEST_CASE(it_completes_through_the_completion_queue) {
    auto [operation, published] = cles::test::record();
    std::vector<std::string> seen;
    completions.call([&] { seen.push_back(published->ended ? "late" : "before"); });
    BOOST_TEST(all.publish_or_wait("speed", "[1]", operation));
    completions.call([&] { seen.push_back(published->ended ? "behind" : "early"); });
    BOOST_TEST(!published->ended);
    BOOST_TEST(due.size() == 3U);
    tell();
    BOOST_TEST(seen == (std::vector<std::string>{"before", "behind"}), boost::test_tools::per_element());
    recording_subscriber slow;
    bind(slow, "speed", 1);
    slow.capacity = 0;
    publish_or_wait("speed", "[2]");
    drain();
    auto [waiting, withdrawn] = cles::test::record();
    BOOST_TEST(!all.publish_or_wait("speed", "[3]", waiting, 7));
    BOOST_TEST(all.cancel(7));
    BOOST_TEST(!withdrawn->ended);
    tell();
    BOOST_TEST((withdrawn->code == errc::cancelled));
}

BOOST_AUTO_TEST_CASE(it_waits_until_the_queue_of_every_subscriber_has_capacity) {
    recording_subscriber slow;
    recording_subscriber quick;
    bind(slow, "speed", 2);
    bind(quick, "speed", 2);
    slow.capacity = 0;
    BOOST_TEST(publish_or_wait("speed", "[1]") == nullptr);
    BOOST_TEST(publish_or_wait("speed", "[2]") == nullptr);
    drain();
    const auto third = publish_or_wait("speed", "[3]");
    BOOST_REQUIRE(third != nullptr);
    BOOST_TEST(!third->ended);
    BOOST_TEST(all.find("speed")->seq() == 2U);
    slow.capacity = 100;
    drain(); // nothing is new, so nothing is drained
    all.find("speed")->drain(clock.now());
    all.admit(*all.find("speed"));
    tell();
    BOOST_TEST(third->ended);
    BOOST_TEST(!third->code);
    BOOST_TEST(all.find("speed")->seq() == 3U);
    drain();
    BOOST_TEST(slow.take().ends_with("seq=3 epoch=5f3a09c1 [3]\n"));
    BOOST_TEST(counts.updates_shed == 0U);
}

BOOST_AUTO_TEST_CASE(waiting_updates_are_published_in_order) {
    recording_subscriber slow;
    bind(slow, "speed", 1);
    slow.capacity = 0;
    publish_or_wait("speed", "[1]");
    drain();
    const auto second = publish_or_wait("speed", "[2]");
    const auto third = publish_or_wait("speed", "[3]");
    BOOST_REQUIRE((second && third));
    slow.capacity = 100;
    auto& noun = *all.find("speed");
    noun.drain(clock.now());
    all.admit(noun);
    BOOST_TEST(!second->ended); // not inside the call
    tell();
    BOOST_TEST(second->ended);
    BOOST_TEST(!third->ended); // the queue is full again
    drain();
    BOOST_TEST(third->ended);
    drain();
    BOOST_TEST(slow.take() == "UPDATE car1:speed seq=1 epoch=5f3a09c1 [1]\n"
                              "UPDATE car1:speed seq=2 epoch=5f3a09c1 [2]\n"
                              "UPDATE car1:speed seq=3 epoch=5f3a09c1 [3]\n");
}

BOOST_AUTO_TEST_CASE(a_later_update_does_not_overtake) {
    recording_subscriber slow;
    bind(slow, "speed", 1);
    slow.capacity = 0;
    publish_or_wait("speed", "[1]");
    drain();
    publish_or_wait("speed", "[2]");
    slow.capacity = 100;
    all.find("speed")->drain(clock.now()); // there is capacity, but the next has not been published yet
    BOOST_TEST(publish_or_wait("speed", "[3]") != nullptr);
}

BOOST_AUTO_TEST_CASE(an_update_that_cannot_be_published_fails_in_its_turn) {
    fixture small{cles::limits{.line = 100}};
    recording_subscriber slow;
    small.bind(slow, "speed", 1);
    slow.capacity = 0;
    small.publish_or_wait("speed", "[1]");
    small.drain();
    const auto large = small.publish_or_wait("speed", "[\"" + std::string(100, 'x') + "\"]");
    const auto next = small.publish_or_wait("speed", "[3]");
    slow.capacity = 100;
    auto& noun = *small.all.find("speed");
    noun.drain(small.clock.now());
    small.all.admit(noun);
    small.tell();
    BOOST_TEST((large->code == errc::too_large));
    BOOST_TEST(next->ended);
    BOOST_TEST(!next->code);
}

BOOST_AUTO_TEST_CASE(waiting_updates_can_be_removed_when_the_node_stops) {
    recording_subscriber slow;
    bind(slow, "speed", 1);
    slow.capacity = 0;
    publish_or_wait("speed", "[1]");
    drain();
    const auto second = publish_or_wait("speed", "[2]");
    {
        auto taken = all.take_waiters();
        BOOST_TEST(taken.size() == 1U);
        BOOST_TEST(!second->ended);
        taken.front().release()->fail(errc::stopped, "the service has been stopped");
    }
    BOOST_TEST((second->code == errc::stopped));
    BOOST_TEST(all.take_waiters().empty());
    BOOST_TEST(all.find("speed")->seq() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
