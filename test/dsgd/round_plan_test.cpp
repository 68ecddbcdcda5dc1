// SPDX-License-Identifier: BSL-1.0
#include "digits/descent.hpp"
#include "dsgd/rounds/round_plan.hpp"
#include "images.hpp"

#include <boost/test/unit_test.hpp>

namespace round_plan {
namespace {

using cles::errc;
using names = std::vector<std::string>;

const digits::shape form{.inputs = 1, .hidden = 1, .classes = 2};

digits::network of(float value) { return {.form = form, .weights = std::vector<float>(form.weights(), value)}; }
cles::error error(errc code) { return {code, "words"}; }

dsgd::round_plan plan_of(const names& nodes, std::uint64_t rounds = 10) {
    dsgd::round_plan out{of(0), rounds};
    for (const auto& node : nodes) {
        out.join(node);
    }
    return out;
}

} // namespace
} // namespace round_plan

BOOST_AUTO_TEST_SUITE(round_plan)

BOOST_AUTO_TEST_CASE(a_round_ends_with_the_mean_by_images) {
    auto plan = plan_of({"a", "b"}, 2);
    BOOST_TEST((plan.to_ask(5) == names{"a", "b"}));
    BOOST_TEST(plan.to_ask(6).empty());
    plan.answered("b", 1, of(4), 30, 0.5, 10);
    BOOST_TEST(!plan.end_round(10));
    plan.answered("a", 1, of(8), 10, 0.1, 12);
    const auto ended = plan.end_round(12);
    BOOST_REQUIRE(ended.has_value());
    BOOST_TEST(ended->round == 1U);
    BOOST_TEST((ended->nodes == names{"a", "b"}));
    BOOST_TEST(ended->late.empty());
    BOOST_TEST(ended->images == 40U);
    BOOST_TEST(ended->loss == 0.4);
    BOOST_TEST(ended->began_ms == 5);
    BOOST_TEST(ended->ended_ms == 12);
    BOOST_TEST((plan.present() == of(5)));
    BOOST_TEST(plan.round() == 2U);
    BOOST_TEST(!plan.finished());
    BOOST_TEST((plan.to_ask(12) == names{"a", "b"}));
    plan.answered("a", 2, of(1), 1, 0, 13);
    plan.answered("b", 2, of(1), 1, 0, 13);
    BOOST_TEST(plan.end_round(13).has_value());
    BOOST_TEST(plan.finished());
    BOOST_TEST(plan.to_ask(14).empty());
    BOOST_TEST(!plan.failure());
}

BOOST_AUTO_TEST_CASE(the_order_of_the_answers_does_not_matter) {
    digits::network means[2];
    for (const bool turned : {false, true}) {
        auto plan = plan_of({"a", "b", "c"});
        plan.to_ask(0);
        for (const auto& node : turned ? names{"c", "a", "b"} : names{"a", "b", "c"}) {
            plan.answered(node, 1, of(0.1F * static_cast<float>(node[0])), 3, 0, 1);
        }
        plan.end_round(1);
        means[turned ? 1 : 0] = plan.present();
    }
    BOOST_TEST((means[0] == means[1]));
}

BOOST_AUTO_TEST_CASE(a_round_does_not_wait_for_a_node_that_is_late) {
    auto plan = plan_of({"a", "b", "c"});
    plan.to_ask(1'000);
    plan.answered("a", 1, of(1), 10, 0, 1'100);
    const auto limit = 1'000 + 100 * dsgd::round_plan::late_factor + dsgd::round_plan::late_more_ms;
    BOOST_TEST(!plan.end_round(limit + 1)); // one of three: nobody knows what is usual
    plan.answered("c", 1, of(3), 10, 0, 1'100);
    BOOST_TEST(!plan.end_round(limit));
    const auto ended = plan.end_round(limit + 1);
    BOOST_REQUIRE(ended.has_value());
    BOOST_TEST((ended->nodes == names{"a", "c"}));
    BOOST_TEST((ended->late == names{"b"}));
    BOOST_TEST((plan.present() == of(2)));
    // It is asked again when it has answered, and its old answer is not used.
    BOOST_TEST((plan.to_ask(2'500) == names{"a", "c"}));
    plan.answered("b", 1, of(100), 10, 0, 2'510);
    plan.answered("a", 2, of(2), 10, 0, 2'600);
    plan.answered("c", 2, of(2), 10, 0, 2'600);
    BOOST_TEST(plan.end_round(2'600).has_value());
    BOOST_TEST((plan.present() == of(2)));
    BOOST_TEST((plan.to_ask(2'600) == names{"a", "b", "c"}));
}

BOOST_AUTO_TEST_CASE(a_node_that_joins_gets_work_from_the_next_round_on) {
    auto plan = plan_of({"a"});
    plan.to_ask(0);
    plan.join("b");
    BOOST_TEST(plan.to_ask(1).empty());
    plan.answered("a", 1, of(1), 10, 0, 2);
    BOOST_TEST(plan.end_round(2).has_value());
    BOOST_TEST((plan.to_ask(2) == names{"a", "b"}));
}

BOOST_AUTO_TEST_CASE(the_others_go_on_without_a_lost_node) {
    for (const auto code : {errc::unavailable, errc::deadline, errc::no_target, errc::no_task}) {
        auto plan = plan_of({"a", "b"});
        plan.to_ask(0);
        plan.answered("a", 1, of(1), 10, 0, 2);
        plan.failed("b", 1, error(code));
        BOOST_TEST((plan.members() == names{"a"}));
        BOOST_TEST(plan.end_round(3).has_value());
        BOOST_TEST((plan.to_ask(3) == names{"a"}));
        // It may join again, and what its former run says does not count.
        plan.join("b");
        plan.failed("b", 1, error(code));
        BOOST_TEST((plan.members() == names{"a", "b"}));
        plan.failed("a", 2, error(code));
        BOOST_TEST(!plan.failure());
        BOOST_TEST(!plan.end_round(4)); // nobody has answered: it begins anew
        BOOST_TEST(plan.round() == 2U);
        BOOST_TEST((plan.to_ask(4) == names{"b"}));
    }
}

BOOST_AUTO_TEST_CASE(without_a_node_it_fails) {
    auto plan = plan_of({"a"});
    plan.to_ask(0);
    plan.failed("a", 1, error(errc::unavailable));
    BOOST_TEST((plan.failure()->code() == errc::unavailable));
    BOOST_TEST(plan.failure()->message() == "a: unavailable: words");
    BOOST_TEST(plan.finished());
    BOOST_TEST(!plan.end_round(1));
}

BOOST_AUTO_TEST_CASE(what_fails_everywhere_ends_it) {
    for (const auto code : {errc::bad_request, errc::failed, errc::denied, errc::conversion}) {
        auto plan = plan_of({"a", "b"});
        plan.to_ask(0);
        plan.failed("a", 1, error(code));
        BOOST_TEST((plan.failure()->code() == code));
        BOOST_TEST(plan.finished());
    }
}

BOOST_AUTO_TEST_CASE(a_busy_node_is_asked_again_but_not_for_ever) {
    auto plan = plan_of({"a", "b"});
    plan.to_ask(0);
    plan.answered("b", 1, of(1), 10, 0, 2);
    for (std::uint64_t i = 0; i < dsgd::round_plan::most_attempts; ++i) {
        plan.failed("a", 1, error(errc::busy));
        BOOST_TEST(!plan.end_round(3)); // it waits for this one
        BOOST_TEST((plan.to_ask(3) == names{"a"}));
    }
    plan.failed("a", 1, error(errc::busy));
    BOOST_TEST((plan.members() == names{"b"}));
    BOOST_TEST(plan.end_round(4).has_value()); // the others go on
    BOOST_TEST(!plan.failure());
    BOOST_TEST((plan.to_ask(4) == names{"b"}));
}

BOOST_AUTO_TEST_CASE(an_answer_that_cannot_be_used_ends_it) {
    for (const bool is_other_shape : {true, false}) {
        auto plan = plan_of({"a"});
        plan.to_ask(0);
        const auto other = digits::made({.inputs = 2, .hidden = 1, .classes = 2}, 1);
        plan.answered("a", 1, is_other_shape ? other : of(1), is_other_shape ? 10 : 0, 0, 2);
        BOOST_REQUIRE(plan.failure().has_value());
        BOOST_TEST((plan.failure()->code() == errc::conversion));
    }
}

// Two nodes with images of their own learn what one with all of them learns.
BOOST_AUTO_TEST_CASE(averaging_learns) {
    const auto test = dsgd_test::rows_of_pixels(200, 9);
    const auto first = dsgd_test::rows_of_pixels(150, 1);
    const auto second = dsgd_test::rows_of_pixels(150, 2, 2); // it has no image of the third class
    dsgd::round_plan plan{digits::made({.inputs = 9, .hidden = 8, .classes = 3}, 5), 20};
    plan.join("a");
    plan.join("b");
    for (double now = 0; !plan.finished(); now += 10) {
        for (const auto& node : plan.to_ask(now)) {
            digits::descent work{node == "a" ? first : second, plan.present(), {.passes = 1, .seed = plan.round()}};
            while (work.step()) {
            }
            plan.answered(node, plan.round(), work.result(), 150, work.mean_loss(), now + 5);
        }
        BOOST_TEST(plan.end_round(now + 5).has_value());
    }
    BOOST_TEST(accuracy(plan.present(), test) > 0.95);
}

BOOST_AUTO_TEST_SUITE_END()
