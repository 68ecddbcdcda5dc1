// SPDX-License-Identifier: BSL-1.0
#include "dsgd/board.hpp"
#include "sgd/parallel.hpp"
#include "sgd/training.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <set>

namespace board {
namespace {

using cles::errc;

cles::error error(errc code) { return {code, "words"}; }
const cles::error refused{boost::system::errc::make_error_code(boost::system::errc::connection_refused), "no link"};

sgd::trained part_of(double ms, double after_ms) { return {.ms = ms, .after_ms = after_ms}; }

// Begins all that nodes can begin.
std::vector<std::size_t> begin_all(dsgd::board& all, double now_ms = 0) {
    std::vector<std::size_t> begun;
    while (const auto attempt = all.next(now_ms)) {
        begun.push_back(*attempt);
    }
    return begun;
}

// Four shards, all of them begun: the numbers of the attempts are those of the shards.
dsgd::board four(const std::vector<std::string>& targets) {
    dsgd::board all{std::vector<sgd::order>(4), targets};
    begin_all(all);
    return all;
}

dsgd::board of_shards(std::size_t count, const std::vector<std::string>& targets) {
    return dsgd::board{std::vector<sgd::order>(count, {.count = 10}), targets};
}

const dsgd::entry& shard_of(const dsgd::board& all, std::size_t attempt) {
    return all.shards()[all.attempts()[attempt].shard];
}

// The answer to an attempt.
std::vector<std::size_t> answer(dsgd::board& all, std::size_t attempt, double now_ms, const std::string& node = {}) {
    return all.done(attempt, {.node = node, .points = shard_of(all, attempt).what.count, .ms = 1, .after_ms = now_ms});
}

} // namespace
} // namespace board

BOOST_AUTO_TEST_SUITE(board)

BOOST_AUTO_TEST_CASE(nodes_have_their_turns) {
    const auto all = four({"a", "b", "c"});
    BOOST_TEST(all.shards()[0].target == "a");
    BOOST_TEST(all.shards()[1].target == "b");
    BOOST_TEST(all.shards()[2].target == "c");
    BOOST_TEST(all.shards()[3].target == "a");
}

BOOST_AUTO_TEST_CASE(what_is_done_is_kept) {
    auto all = four({"any"});
    BOOST_TEST(all.shards()[2].fate == "open");
    all.done(2, {.node = "b", .points = 7});
    BOOST_TEST(all.shards()[2].fate == "done");
    BOOST_TEST(all.parts()[2].node == "b");
    BOOST_TEST(all.parts()[2].points == 7U);
    BOOST_TEST(!all.failure());
}

BOOST_AUTO_TEST_CASE(a_lost_nodes_shards_go_to_those_that_have_the_fewest) {
    for (const auto& why : {error(errc::unavailable), error(errc::deadline), error(errc::no_target), refused}) {
        auto all = four({"a", "b", "c"});
        all.done(1, {});
        BOOST_TEST(all.failed(0, why, 0)); // a has two shards, b none, c one
        BOOST_TEST(all.shards()[0].target == "b");
        BOOST_TEST(all.failed(3, why, 0));
        BOOST_TEST(all.shards()[3].fate == "open");
        BOOST_TEST((std::set<std::string>{"b", "c"}).contains(all.shards()[3].target));
        BOOST_TEST(all.shards()[0].trouble.size() == 1U);
        BOOST_TEST(all.shards()[0].trouble[0].starts_with("a: "));
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_was_lost_is_not_asked_again) {
    auto all = four({"a", "b"});
    BOOST_TEST(all.failed(0, error(errc::unavailable), 0));
    BOOST_TEST(all.shards()[0].target == "b");
    BOOST_TEST(all.failed(2, error(errc::unavailable), 0));
    BOOST_TEST(all.shards()[2].target == "b");
    BOOST_TEST(!all.failed(1, error(errc::unavailable), 0));
    BOOST_TEST(all.shards()[1].fate == "failed");
    BOOST_TEST((all.failure()->code() == errc::unavailable));
    BOOST_TEST(all.failure()->message() == "shard 2: b: unavailable: words");
}

BOOST_AUTO_TEST_CASE(any_is_asked_again_until_there_is_nobody) {
    auto all = four({"any"});
    BOOST_TEST(all.failed(0, error(errc::unavailable), 0));
    BOOST_TEST(all.failed(0, error(errc::deadline), 0));
    BOOST_TEST(all.shards()[0].target == "any");
    BOOST_TEST(!all.failed(0, error(errc::no_target), 0));
    BOOST_TEST(all.shards()[0].fate == "failed");
    BOOST_TEST(all.shards()[0].trouble.size() == 3U);
}

BOOST_AUTO_TEST_CASE(a_busy_node_is_asked_again_but_not_for_ever) {
    auto all = four({"a", "b"});
    for (std::size_t i = 1; i < dsgd::board::max_attempts; ++i) {
        BOOST_TEST(all.failed(0, error(errc::busy), 0));
        BOOST_TEST(all.shards()[0].target == "a");
    }
    BOOST_TEST(!all.failed(0, error(errc::busy), 0));
    BOOST_TEST((all.failure()->code() == errc::busy));
}

BOOST_AUTO_TEST_CASE(what_fails_everywhere_is_not_tried_elsewhere) {
    for (const auto code : {errc::bad_request, errc::failed, errc::no_task, errc::denied, errc::conversion}) {
        auto all = four({"a", "b"});
        BOOST_TEST(!all.failed(0, error(code), 0));
        BOOST_TEST((all.failure()->code() == code));
    }
}

BOOST_AUTO_TEST_CASE(the_first_failure_ends_all) {
    auto all = four({"a", "b"});
    all.done(3, {});
    BOOST_TEST(!all.failed(0, error(errc::failed), 0));
    BOOST_TEST(!all.failed(1, error(errc::stopped), 0));
    BOOST_TEST(!all.failed(2, error(errc::stopped), 0));
    BOOST_TEST(all.shards()[0].fate == "failed");
    BOOST_TEST(all.shards()[1].fate == "withdrawn");
    BOOST_TEST(all.shards()[2].fate == "withdrawn");
    BOOST_TEST(all.shards()[3].fate == "done");
    BOOST_TEST(all.failure()->message().starts_with("shard 1: "));
}

BOOST_AUTO_TEST_CASE(each_shard_is_begun_once) {
    auto all = of_shards(4, {"a"});
    BOOST_TEST(all.slots() == 4U);
    BOOST_TEST(begin_all(all).size() == 4U);
    BOOST_TEST(begin_all(all).empty());
    BOOST_TEST(!all.finished());
    for (std::size_t i = 0; i < 4; ++i) {
        BOOST_TEST(all.attempts()[i].shard == i);
        answer(all, i, 10);
    }
    BOOST_TEST(all.finished());
}

BOOST_AUTO_TEST_CASE(a_node_has_as_many_shards_at_a_time_as_workers) {
    auto all = of_shards(10, {"a", "b"});
    all.join("a", 2);
    all.join("b", 1);
    BOOST_TEST(begin_all(all).size() == 3U);
    BOOST_TEST(all.attempts()[0].target == "a");
    BOOST_TEST(all.attempts()[1].target == "b");
    BOOST_TEST(all.attempts()[2].target == "a");
    answer(all, 1, 10);
    BOOST_TEST(begin_all(all, 10).size() == 1U);
    BOOST_TEST(all.attempts()[3].target == "b");
    BOOST_TEST(all.attempts()[3].shard == 3U);
    BOOST_TEST(all.attempts()[3].begun_ms == 10);
}

BOOST_AUTO_TEST_CASE(any_gets_as_many_as_all_nodes_have_workers) {
    auto all = of_shards(70, {});
    all.join("a", 2);
    all.join("b", 3);
    BOOST_TEST(begin_all(all).size() == 5U);
    BOOST_TEST(all.attempts()[4].target == "any");
    BOOST_TEST(answer(all, 0, 10, "a").empty());
    BOOST_TEST(begin_all(all, 10).size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_node_that_joins_gets_shards) {
    auto all = of_shards(70, {});
    all.join("a", 4);
    BOOST_TEST(begin_all(all).size() == 4U);
    all.join("b", 4);
    BOOST_TEST(begin_all(all).size() == 4U); // which `any` gives to the node without load
    // With a splitter, it has as many slots as the others.
    dsgd::board split{16'000, 4, {.rate = 0.01}, {"a", "b"}};
    BOOST_TEST(begin_all(split).size() == 4U);
    split.join("c", 4);
    BOOST_TEST(split.slots() == 6U);
    BOOST_TEST(begin_all(split).size() == 2U);
    BOOST_TEST(split.attempts()[4].target == "c");
    BOOST_TEST(split.attempts()[5].target == "c");
    split.join("c", 4); // again
    BOOST_TEST(split.slots() == 6U);
}

BOOST_AUTO_TEST_CASE(without_a_count_of_workers_all_is_begun_at_once) {
    auto all = of_shards(70, {});
    all.join("a", 4);
    all.join("b", 0);
    BOOST_TEST(begin_all(all).size() == 70U);
}

BOOST_AUTO_TEST_CASE(a_lost_nodes_other_shards_go_to_others) {
    auto all = of_shards(6, {"a", "b"});
    all.join("a", 1);
    all.join("b", 1);
    begin_all(all);
    BOOST_TEST(all.failed(0, error(errc::unavailable), 5));
    BOOST_TEST(all.attempts()[0].target == "b");
    BOOST_TEST(all.attempts()[0].begun_ms == 5);
    for (std::size_t i = 1; i < 6; ++i) {
        BOOST_TEST(all.shards()[i].target == "b");
    }
}

BOOST_AUTO_TEST_CASE(what_was_not_begun_is_withdrawn_after_a_failure) {
    auto all = of_shards(4, {"a"});
    all.join("a", 2);
    begin_all(all);
    BOOST_TEST(!all.failed(0, error(errc::failed), 0));
    BOOST_TEST(all.shards()[2].fate == "withdrawn");
    BOOST_TEST(all.shards()[3].fate == "withdrawn");
    BOOST_TEST(!all.failed(1, error(errc::stopped), 0));
    BOOST_TEST(all.finished());
    BOOST_TEST(!all.next(0));
}

// -- late shards -----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_late_shard_goes_to_another_node_as_well) {
    auto all = of_shards(4, {"a", "b"});
    begin_all(all);
    BOOST_TEST(!all.late(1e9)); // nothing has ended, so nothing is late
    answer(all, 0, 90);
    answer(all, 2, 110);
    answer(all, 3, 100); // b lives
    const auto limit = 100 * dsgd::board::late_factor + dsgd::board::late_more_ms;
    BOOST_TEST(!all.late(limit));
    const auto copy = all.late(limit + 1);
    BOOST_REQUIRE(copy.has_value());
    BOOST_TEST(all.attempts()[*copy].target == "a");
    BOOST_TEST(all.attempts()[*copy].shard == 1U);
    BOOST_TEST((all.shards()[1].also == std::vector<std::string>{"a"}));
    BOOST_TEST(all.shards()[1].fate == "open");
    BOOST_TEST(!all.late(limit + 2)); // the copy is not late yet
}

BOOST_AUTO_TEST_CASE(the_first_answer_counts) {
    for (const bool copy_is_first : {false, true}) {
        auto all = of_shards(3, {"a", "b"});
        begin_all(all);
        answer(all, 0, 100);
        answer(all, 2, 100);
        const auto copy = *all.late(500);
        const std::size_t first = copy_is_first ? copy : 1;
        const std::size_t second = copy_is_first ? 1 : copy;
        BOOST_TEST((all.done(first, {.node = "first", .points = 10, .after_ms = 600}) == std::vector{second}));
        BOOST_TEST(all.parts()[1].node == "first");
        BOOST_TEST(all.finished());
        // The other one ends, in whatever way.
        BOOST_TEST(all.done(second, {.node = "second", .points = 10, .after_ms = 601}).empty());
        BOOST_TEST(!all.failed(second, error(errc::cancelled), 601));
        BOOST_TEST(all.parts()[1].node == "first");
        BOOST_TEST(all.shards()[1].trouble.empty());
        BOOST_TEST(!all.failure());
        // A node whose shard another one had to train gets no more.
        BOOST_TEST(all.nodes().contains("b") != copy_is_first);
    }
}

BOOST_AUTO_TEST_CASE(the_other_shards_of_a_node_that_was_overtaken_go_elsewhere) {
    auto all = of_shards(8, {"a", "b"});
    all.join("a", 1);
    all.join("b", 1);
    begin_all(all);
    double now = 0;
    for (std::size_t attempt = 0; attempt != 1;) { // a trains its own ones
        answer(all, attempt, now += 100);
        const auto begun = begin_all(all, now);
        attempt = begun.empty() ? 1 : begun.front();
    }
    const auto copy = *all.late(now + 100);
    BOOST_TEST((answer(all, copy, now + 200) == std::vector<std::size_t>{1}));
    const auto next = begin_all(all, now + 200);
    BOOST_TEST(next.size() == 1U);
    BOOST_TEST(all.attempts()[next[0]].target == "a");
    BOOST_TEST(all.shards()[7].target == "a");
}

BOOST_AUTO_TEST_CASE(a_late_shard_of_any_goes_to_a_node_that_answers) {
    auto all = of_shards(4, {});
    for (const auto* node : {"a", "b", "c"}) {
        all.join(node, 2);
    }
    begin_all(all);
    answer(all, 0, 100, "c"); // after the others were begun
    answer(all, 1, 100, "c");
    const auto first = *all.late(500);
    BOOST_TEST(all.attempts()[first].target == "c");
    const auto second = *all.late(500);
    BOOST_TEST(all.attempts()[second].target == "c");
    BOOST_TEST(!all.late(500));
    BOOST_TEST(all.shards()[2].target == "any");
}

BOOST_AUTO_TEST_CASE(late_shards_wait_for_a_free_worker) {
    auto all = of_shards(4, {"a", "b"});
    all.join("a", 1);
    all.join("b", 1);
    begin_all(all);
    answer(all, 0, 100);
    begin_all(all, 100);
    BOOST_TEST(!all.late(10'000)); // a has its second shard, which is late, too
    answer(all, 2, 10'000);
    BOOST_TEST(all.late(100'000).has_value());
}

BOOST_AUTO_TEST_CASE(a_node_that_fails_meanwhile_is_not_missed) {
    auto all = of_shards(3, {"a", "b"});
    begin_all(all);
    answer(all, 0, 100);
    answer(all, 2, 100);
    const auto copy = *all.late(500);
    BOOST_TEST(!all.failed(1, error(errc::unavailable), 510)); // the copy goes on
    BOOST_TEST(all.shards()[1].fate == "open");
    BOOST_TEST(all.shards()[1].trouble.size() == 1U);
    answer(all, copy, 600);
    BOOST_TEST(all.finished());
    BOOST_TEST(!all.failure());
}

// The last answer that is waited for may come from a node that was given up because of another shard.
BOOST_AUTO_TEST_CASE(where_all_nodes_are_lost_the_last_attempt_decides) {
    for (const bool answers : {true, false}) {
        dsgd::board split{16'000, 3, {.rate = 0.01}, {"a", "b"}};
        begin_all(split);      // a has the first and the third
        answer(split, 1, 100); // b
        split.join("a", 2);    // no more at a time
        const auto copy = *split.late(1'000);
        BOOST_TEST(split.attempts()[copy].target == "b");
        BOOST_TEST(split.attempts()[copy].shard == 0U);
        BOOST_TEST(!split.failed(2, error(errc::deadline), 1'010));
        BOOST_TEST(!split.failed(copy, error(errc::unavailable), 1'020));
        BOOST_TEST(split.nodes().empty());
        BOOST_TEST(!split.failure());
        BOOST_TEST(!split.next(1'020));
        if (answers) {
            answer(split, 0, 1'030);
            BOOST_TEST(split.attempts()[*split.next(1'030)].target == "a");
        } else {
            BOOST_TEST(!split.failed(0, error(errc::unavailable), 1'030));
            BOOST_TEST(split.failure().has_value());
        }
    }
    auto named = of_shards(7, {"a", "b"});
    named.join("a", 2);
    named.join("b", 2);
    begin_all(named); // a has the first and the third, b the second and the fourth
    answer(named, 1, 100);
    answer(named, 3, 100);
    const auto first = *named.late(1'000);
    const auto second = *named.late(1'000);
    BOOST_TEST(named.attempts()[second].shard == 2U);
    BOOST_TEST(!named.failed(first, error(errc::unavailable), 1'010)); // at b
    BOOST_TEST(!named.failed(2, error(errc::deadline), 1'020));        // at a
    BOOST_TEST(named.nodes().empty());
    BOOST_TEST(!named.failure());
    BOOST_TEST(!named.next(1'020));
    answer(named, second, 1'030);
    BOOST_TEST(named.next(1'030).has_value());
}

BOOST_AUTO_TEST_CASE(so_many_nodes_are_asked_as_well_and_no_more) {
    auto all = of_shards(6, {"a", "b", "c", "d", "e", "f"});
    begin_all(all);
    for (std::size_t i = 1; i < 6; ++i) {
        answer(all, i, 100);
    }
    double now = 500;
    for (std::size_t i = 0; i < dsgd::board::most_copies; ++i, now += 500) {
        BOOST_TEST(all.late(now).has_value());
    }
    BOOST_TEST(!all.late(now));
    const auto& also = all.shards()[0].also;
    BOOST_TEST(std::set<std::string>(also.begin(), also.end()).size() == dsgd::board::most_copies);
}

// Slots have shards of different sizes: each is measured by its own speed.
BOOST_AUTO_TEST_CASE(with_a_splitter_a_slow_slot_is_not_late) {
    dsgd::board all{160'000, 2, {.rate = 0.01}, {"a", "b"}};
    begin_all(all);
    answer(all, 0, 100);
    answer(all, 1, 1'000); // b is ten times as slow
    const auto second = *all.next(1'000);
    BOOST_TEST(shard_of(all, second).slot == 0U);
    const auto slow = *all.next(1'000);
    const auto expected = static_cast<double>(shard_of(all, slow).what.count) / 10;
    answer(all, second, 1'100);
    BOOST_TEST(!all.late(1'000 + expected * 2));
    const auto copy = all.late(1'000 + expected * dsgd::board::late_factor + dsgd::board::late_more_ms + 1);
    BOOST_REQUIRE(copy.has_value());
    BOOST_TEST(all.attempts()[*copy].shard == all.attempts()[slow].shard);
}

BOOST_AUTO_TEST_CASE(overhead_is_what_the_longest_shard_does_not_take) {
    auto all = four({"a"});
    all.done(0, part_of(5, 6));
    all.done(1, part_of(4, 9));
    all.done(2, part_of(7, 8));
    all.done(3, part_of(1, 2));
    BOOST_TEST(all.spent().elapsed_ms == 9);
    BOOST_TEST(all.spent().longest_ms == 7);
    BOOST_TEST(all.spent().overhead_ms == 2);
    BOOST_TEST(all.spent(100).elapsed_ms == 109);
    BOOST_TEST(all.spent(100).overhead_ms == 102);
}

BOOST_AUTO_TEST_CASE(what_is_left_is_split_again) {
    dsgd::board all{16'000, 2, {.epochs = 3, .rate = 0.01, .seed = 5}, {"a", "b"}};
    BOOST_TEST(all.points() == 16'000U);
    BOOST_TEST(begin_all(all).size() == 2U);
    BOOST_TEST(!all.shards()[1].what.start);
    all.done(1, {.result = {{1, 2}, 3}, .ms = 80, .after_ms = 100});
    BOOST_TEST(*all.next(100) == 2U);
    BOOST_TEST(!all.next(100));
    const auto& third = all.shards()[2];
    BOOST_TEST(third.target == "b");
    BOOST_TEST(third.slot == 1U);
    BOOST_TEST(third.what.first == 2'000U);
    BOOST_TEST(third.what.count == 1'750U);
    BOOST_TEST((*third.what.start == sgd::classifier{{1, 2}, 3})); // where the slot's last one ended
    BOOST_TEST(*third.what.seed == 7U);
    BOOST_TEST(*third.what.epochs == 3U);
    all.done(2, part_of(30, 150));
    BOOST_TEST(all.spent().longest_ms == 110); // of both shards of the slot
}

BOOST_AUTO_TEST_CASE(a_lost_node_gets_no_more_shards) {
    dsgd::board all{16'000, 2, {.rate = 0.01}, {"a", "b"}};
    begin_all(all);
    BOOST_TEST(!all.failed(1, error(errc::unavailable), 40));
    BOOST_TEST(all.shards()[1].fate == "lost");
    const auto again = *all.next(50);
    BOOST_TEST(shard_of(all, again).slot == 1U);
    BOOST_TEST(shard_of(all, again).target == "a");
    BOOST_TEST(shard_of(all, again).what.first == all.shards()[1].what.first);
    all.done(again, part_of(80, 100));
    BOOST_TEST(shard_of(all, *all.next(100)).target == "a");
}

BOOST_AUTO_TEST_CASE(all_slots_train_on_a_lost_nodes_second_shard) {
    dsgd::board all{16'000, 2, {.rate = 0.01}, {"a", "b"}};
    begin_all(all);
    all.done(0, part_of(100, 100));
    const auto second_of_a = *all.next(100);
    all.done(1, part_of(100, 100));
    const auto second = *all.next(100);
    BOOST_TEST(shard_of(all, second).slot == 1U);
    double now = 200;
    for (auto attempt = second_of_a;; now += 100) {
        all.done(attempt, part_of(100, now));
        const auto next = all.next(now);
        if (!next) {
            break;
        }
        attempt = *next;
    }
    BOOST_TEST(!all.finished());
    BOOST_TEST(!all.failed(second, error(errc::deadline), now));
    const auto lost = shard_of(all, second).what;
    std::set<std::size_t> slots;
    for (auto begun = begin_all(all, now); !begun.empty(); begun = begin_all(all, now)) {
        now += 50;
        for (const auto attempt : begun) {
            const auto& shard = shard_of(all, attempt);
            BOOST_TEST(shard.target == "a");
            BOOST_TEST(shard.what.first >= lost.first);
            BOOST_TEST(shard.what.first + shard.what.count <= lost.first + lost.count);
            slots.insert(shard.slot);
            all.done(attempt, part_of(50, now));
        }
    }
    BOOST_TEST(slots.size() == 2U);
    BOOST_TEST(all.finished());
    std::uint64_t points = 0;
    for (const auto& entry : all.shards()) {
        points += entry.fate == "done" ? entry.what.count : 0;
    }
    BOOST_TEST(points == 16'000U);
}

BOOST_AUTO_TEST_CASE(without_another_node_a_lost_shard_has_failed) {
    dsgd::board all{16'000, 1, {.rate = 0.01}, {"a"}};
    begin_all(all);
    BOOST_TEST(!all.failed(0, error(errc::unavailable), 0));
    BOOST_TEST(all.shards()[0].fate == "failed");
    BOOST_TEST(all.finished());
}

// The classifier of all points, as slots that are equally fast train it one after the other.
BOOST_AUTO_TEST_CASE(many_slots_or_few_steps_give_as_good_a_classifier) {
    const sgd::data_set data{sgd::recipe{}};
    struct {
        std::uint64_t epochs;
        std::size_t slots;
    } const cases[] = {{1, 4}, {2, 4}, {1, 64}, {20, 64}, {100, 1'024}};
    for (const auto& [epochs, slots] : cases) {
        BOOST_TEST_CONTEXT(epochs << " epochs, " << slots << " slots") {
            const sgd::order like{.epochs = epochs, .rate = 1e-4, .seed = 1};
            dsgd::board all{data.size(), slots, like, {"a"}};
            double now = 0;
            for (auto begun = begin_all(all); !begun.empty(); begun = begin_all(all, now)) {
                for (const auto attempt : begun) { // slots that are equally fast
                    const auto what = shard_of(all, attempt).what;
                    sgd::training work{data,
                                       {what.first, what.count},
                                       {.steps = epochs * what.count, .rate = 1e-4, .seed = *what.seed},
                                       what.start.value_or(sgd::classifier{})};
                    while (work.step()) {
                    }
                    now = all.attempts()[attempt].begun_ms + double(epochs * what.count) / 50'000;
                    all.done(attempt, {.result = work.result(), .points = what.count, .after_ms = now});
                }
            }
            const auto found = judge(data, average(all.parts()));
            BOOST_TEST(found.mse <= found.least_mse * 1.01);
        }
    }
}

BOOST_AUTO_TEST_CASE(after_a_failure_no_shards_are_made) {
    dsgd::board all{16'000, 2, {.rate = 0.01}, {"a"}};
    begin_all(all);
    BOOST_TEST(!all.failed(0, error(errc::failed), 0));
    all.done(1, part_of(80, 100));
    BOOST_TEST(!all.next(100));
}

BOOST_AUTO_TEST_SUITE_END()
