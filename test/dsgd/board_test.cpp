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

dsgd::board four(const std::vector<std::string>& targets) { return dsgd::board{std::vector<sgd::order>(4), targets}; }

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
        BOOST_TEST(all.failed(0, why)); // a has two shards, b none, c one
        BOOST_TEST(all.shards()[0].target == "b");
        BOOST_TEST(all.failed(3, why));
        BOOST_TEST(all.shards()[3].fate == "open");
        BOOST_TEST((std::set<std::string>{"b", "c"}).contains(all.shards()[3].target));
        BOOST_TEST(all.shards()[0].trouble.size() == 1U);
        BOOST_TEST(all.shards()[0].trouble[0].starts_with("a: "));
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_was_lost_is_not_asked_again) {
    auto all = four({"a", "b"});
    BOOST_TEST(all.failed(0, error(errc::unavailable)));
    BOOST_TEST(all.shards()[0].target == "b");
    BOOST_TEST(all.failed(2, error(errc::unavailable)));
    BOOST_TEST(all.shards()[2].target == "b");
    BOOST_TEST(!all.failed(1, error(errc::unavailable)));
    BOOST_TEST(all.shards()[1].fate == "failed");
    BOOST_TEST((all.failure()->code() == errc::unavailable));
    BOOST_TEST(all.failure()->message() == "shard 2: b: unavailable: words");
}

BOOST_AUTO_TEST_CASE(any_is_asked_again_until_there_is_nobody) {
    auto all = four({"any"});
    BOOST_TEST(all.failed(0, error(errc::unavailable)));
    BOOST_TEST(all.failed(0, error(errc::deadline)));
    BOOST_TEST(all.shards()[0].target == "any");
    BOOST_TEST(!all.failed(0, error(errc::no_target)));
    BOOST_TEST(all.shards()[0].fate == "failed");
    BOOST_TEST(all.shards()[0].trouble.size() == 3U);
}

BOOST_AUTO_TEST_CASE(a_busy_node_is_asked_again_but_not_for_ever) {
    auto all = four({"a", "b"});
    for (std::size_t i = 1; i < dsgd::board::max_attempts; ++i) {
        BOOST_TEST(all.failed(0, error(errc::busy)));
        BOOST_TEST(all.shards()[0].target == "a");
    }
    BOOST_TEST(!all.failed(0, error(errc::busy)));
    BOOST_TEST((all.failure()->code() == errc::busy));
}

BOOST_AUTO_TEST_CASE(what_fails_everywhere_is_not_tried_elsewhere) {
    for (const auto code : {errc::bad_request, errc::failed, errc::no_task, errc::denied, errc::conversion}) {
        auto all = four({"a", "b"});
        BOOST_TEST(!all.failed(0, error(code)));
        BOOST_TEST((all.failure()->code() == code));
    }
}

BOOST_AUTO_TEST_CASE(the_first_failure_ends_all) {
    auto all = four({"a", "b"});
    all.done(3, {});
    BOOST_TEST(!all.failed(0, error(errc::failed)));
    BOOST_TEST(!all.failed(1, error(errc::stopped)));
    BOOST_TEST(!all.failed(2, error(errc::stopped)));
    BOOST_TEST(all.shards()[0].fate == "failed");
    BOOST_TEST(all.shards()[1].fate == "withdrawn");
    BOOST_TEST(all.shards()[2].fate == "withdrawn");
    BOOST_TEST(all.shards()[3].fate == "done");
    BOOST_TEST(all.failure()->message().starts_with("shard 1: "));
}

BOOST_AUTO_TEST_CASE(a_slot_has_one_shard) {
    auto all = four({"a"});
    BOOST_TEST(all.slots() == 4U);
    BOOST_TEST(*all.next(2, 0) == 2U);
    BOOST_TEST(!all.next(2, 0));
    BOOST_TEST(*all.next(0, 0) == 0U);
    BOOST_TEST(!all.finished());
    for (std::size_t i = 0; i < 4; ++i) {
        all.done(i, {});
    }
    BOOST_TEST(all.finished());
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
    BOOST_TEST(*all.next(0, 0) == 0U);
    BOOST_TEST(*all.next(1, 0) == 1U);
    BOOST_TEST(!all.shards()[1].what.start);
    all.done(1, {.result = {{1, 2}, 3}, .ms = 80, .after_ms = 100});
    BOOST_TEST(*all.next(1, 100) == 2U);
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
    all.next(0, 0);
    all.next(1, 0);
    BOOST_TEST(all.failed(1, error(errc::unavailable)));
    BOOST_TEST(all.shards()[1].fate == "lost");
    BOOST_TEST(all.shards()[1].target == "b");
    const auto again = *all.next(1, 50);
    BOOST_TEST(all.shards()[again].target == "a");
    BOOST_TEST(all.shards()[again].what.first == all.shards()[1].what.first);
    all.done(again, part_of(80, 100));
    BOOST_TEST(all.shards()[*all.next(1, 100)].target == "a");
}

BOOST_AUTO_TEST_CASE(all_slots_train_on_a_lost_nodes_second_shard) {
    dsgd::board all{16'000, 2, {.rate = 0.01}, {"a", "b"}};
    all.next(0, 0);
    all.next(1, 0);
    all.done(0, part_of(100, 100));
    all.done(1, part_of(100, 100));
    const auto second = *all.next(1, 100);
    double now = 100;
    while (const auto shard = all.next(0, now)) {
        now += 100;
        all.done(*shard, part_of(100, now));
    }
    BOOST_TEST(!all.finished()); // slot 0 has to stay
    BOOST_TEST(all.failed(second, error(errc::deadline)));
    const auto lost = all.shards()[second].what;
    std::set<std::size_t> slots;
    for (std::size_t slot = 1;; slot = 1 - slot) {
        const auto shard = all.next(slot, now);
        if (!shard) {
            break;
        }
        const auto& entry = all.shards()[*shard];
        BOOST_TEST(entry.target == "a");
        BOOST_TEST(entry.what.first >= lost.first);
        BOOST_TEST(entry.what.first + entry.what.count <= lost.first + lost.count);
        slots.insert(slot);
        now += 50;
        all.done(*shard, part_of(50, now));
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
    all.next(0, 0);
    BOOST_TEST(!all.failed(0, error(errc::unavailable)));
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
            std::vector<double> now(slots);
            std::vector<std::optional<std::size_t>> shards(slots);
            for (std::size_t slot = 0; slot < slots; ++slot) {
                shards[slot] = all.next(slot, 0);
            }
            const auto none = [](const auto& shard) { return !shard; };
            while (!std::all_of(shards.begin(), shards.end(), none)) {
                for (std::size_t slot = 0; slot < slots; ++slot) {
                    if (!shards[slot]) {
                        continue;
                    }
                    const auto what = all.shards()[*shards[slot]].what;
                    sgd::training work{data,
                                       {what.first, what.count},
                                       {.steps = epochs * what.count, .rate = 1e-4, .seed = *what.seed},
                                       what.start.value_or(sgd::classifier{})};
                    while (work.step()) {
                    }
                    now[slot] += double(epochs * what.count) / 50'000;
                    all.done(*shards[slot], {.result = work.result(), .points = what.count, .after_ms = now[slot]});
                    shards[slot] = all.next(slot, now[slot]);
                }
            }
            const auto found = judge(data, average(all.parts()));
            BOOST_TEST(found.mse <= found.least_mse * 1.01);
        }
    }
}

BOOST_AUTO_TEST_CASE(after_a_failure_no_shards_are_made) {
    dsgd::board all{16'000, 2, {.rate = 0.01}, {"a"}};
    all.next(0, 0);
    all.next(1, 0);
    BOOST_TEST(!all.failed(0, error(errc::failed)));
    all.done(1, part_of(80, 100));
    BOOST_TEST(!all.next(1, 100));
}

BOOST_AUTO_TEST_SUITE_END()
