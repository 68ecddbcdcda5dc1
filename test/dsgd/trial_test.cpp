// SPDX-License-Identifier: BSL-1.0
#include "dsgd/trial.hpp"
#include "sgd/parallel.hpp"

#include <boost/test/unit_test.hpp>

namespace trial {
namespace {

sgd::trained part_of(const char* node, std::uint64_t steps, double after_ms) {
    return {.node = node, .points = steps, .steps = steps, .ms = after_ms, .after_ms = after_ms};
}

constexpr std::uint64_t points = 1'000;
const sgd::order work{.epochs = 4'000};

// Each shard takes so many milliseconds for an epoch.
dsgd::board done(const dsgd::trial& t, std::vector<double> epoch_ms) {
    auto all = t.attempt();
    while (all.next(0)) {
    }
    for (std::size_t i = 0; i < epoch_ms.size(); ++i) {
        const auto& shard = all.shards()[i];
        const auto epochs = *shard.what.epochs;
        all.done(i, part_of(shard.target.c_str(), epochs * shard.what.count, epoch_ms[i] * double(epochs)));
    }
    return all;
}

} // namespace
} // namespace trial

BOOST_AUTO_TEST_SUITE(trial)

BOOST_AUTO_TEST_CASE(a_node_that_is_twice_as_fast_has_shards_twice_as_large) {
    const auto of = dsgd::speeds({part_of("fast", 100, 10), part_of("slow", 100, 20)});
    BOOST_TEST((sgd::divide(300, of) == std::vector<sgd::shard>{{0, 200}, {200, 100}}));
}

// Two workers, four shards: the last two waited for the first two.
BOOST_AUTO_TEST_CASE(what_waits_for_a_worker_counts) {
    const auto of = dsgd::speeds({part_of("small", 100, 10), part_of("small", 100, 10), part_of("small", 100, 20),
                                  part_of("small", 100, 20), part_of("large", 100, 10)});
    BOOST_TEST(of[0] == of[3]);
    BOOST_TEST(of[0] == 5.0);
    BOOST_TEST(of[4] == 10.0);
}

BOOST_AUTO_TEST_CASE(a_part_of_the_work_is_enough_if_it_takes_long) {
    dsgd::trial t{points, 2, work, {"a", "b"}};
    BOOST_TEST(*t.attempt().shards()[0].what.epochs == 200U);
    t.take(done(t, {1.5, 4.5}));
    BOOST_TEST(t.finished());
    BOOST_TEST(t.attempts() == 1U);
    BOOST_TEST(t.shortest_ms() == 300);
    BOOST_TEST(t.spent_ms() == 900);
    BOOST_TEST((sgd::divide(1'000, t.weights()) == std::vector<sgd::shard>{{0, 750}, {750, 250}}));
}

BOOST_AUTO_TEST_CASE(it_goes_on_until_no_shard_is_too_short) {
    dsgd::trial t{points, 2, work, {"a", "b"}};
    t.take(done(t, {0.75, 3})); // 150 ms and 600 ms: within a quota, the first may have run almost all the time
    BOOST_TEST(!t.finished());
    BOOST_TEST(*t.attempt().shards()[0].what.epochs == 500U);
    t.take(done(t, {1.5, 3}));
    BOOST_TEST(t.finished());
    BOOST_TEST(t.attempts() == 2U);
    BOOST_TEST(t.shortest_ms() == 750);
    BOOST_TEST(t.spent_ms() == 2'100);
    BOOST_TEST((sgd::divide(900, t.weights()) == std::vector<sgd::shard>{{0, 600}, {600, 300}}));
}

BOOST_AUTO_TEST_CASE(it_never_takes_more_than_a_quarter_of_the_work) {
    dsgd::trial t{points, 1, {.epochs = 50}, {"a"}};
    BOOST_TEST(*t.attempt().shards()[0].what.epochs == 2U);
    t.take(done(t, {0.001}));
    BOOST_TEST(!t.finished());
    BOOST_TEST(*t.attempt().shards()[0].what.epochs == 12U);
    t.take(done(t, {0.001}));
    BOOST_TEST(t.finished());
}

BOOST_AUTO_TEST_CASE(shards_of_a_lost_node_stay_where_they_were_done) {
    dsgd::trial t{points, 2, work, {"a", "b"}};
    auto all = t.attempt();
    while (all.next(0)) {
    }
    const auto epochs = *all.shards()[0].what.epochs;
    all.done(0, part_of("a", 500, 400));
    all.done(1, part_of("a", 500, 5'000));
    t.take(all);
    BOOST_TEST((t.targets() == std::vector<std::string>{"a", "a"}));
    BOOST_TEST(!t.finished()); // 5000 ms contain the time of the lost node
    BOOST_TEST(*t.attempt().shards()[1].what.epochs == epochs);
    t.take(done(t, {2, 4}));
    BOOST_TEST(t.finished());
    BOOST_TEST(t.weights()[0] == t.weights()[1]);
    BOOST_TEST(t.spent_ms() == 5'800);
}

BOOST_AUTO_TEST_SUITE_END()
