// SPDX-License-Identifier: BSL-1.0
#include "core/turns.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace turns {
namespace {

using namespace cles::test;
namespace core = cles::core;

struct link final : core::turn_taker, core::binder, std::enable_shared_from_this<link> {
    explicit link(core::turns& all) : turns(all) {}
    void flush() override { act("flush"); }
    bool write() override {
        act("write");
        return takes_all;
    }
    bool asks_alone() override { return alone; }
    std::shared_ptr<core::turn_taker> share() override { return shared_from_this(); }
    [[nodiscard]] bool takes_updates() const override { return true; }
    void put_updates(std::string_view lines) override {
        updates += static_cast<std::size_t>(std::ranges::count(lines, '\n'));
        turns.flush_soon(*this);
    }
    void act(const std::string& what) {
        done.push_back(what);
        if (during) {
            std::exchange(during, nullptr)();
        }
    }

    core::turns& turns;
    std::vector<std::string> done;
    std::size_t updates = 0;
    std::function<void()> during; // once
    bool takes_all = true;
    bool alone = false;
};

struct host final : core::turn_host {
    void post_turn() override { ++posted; }
    [[nodiscard]] bool stopped() const override { return is_stopped; }
    [[nodiscard]] core::publications& published() override { return node.host->published; }
    void route_on(cles::time_point) override { ++routed; }
    void settle() override { ++settled; }

    test_node node;
    core::turns turns{*this, node.clock};
    int posted = 0;
    int routed = 0;
    int settled = 0;
    bool is_stopped = false;
};

struct fixture {
    // Those that were posted, until there is none.
    void take_turns() {
        while (node.posted != 0) {
            --node.posted;
            node.turns.turn();
        }
    }
    void update(const std::string& noun) {
        node.turns.let([&] { node.node.publish(noun, "1"); });
    }
    void bind(const std::string& noun) { node.published().open(noun).bind(*one, {}); }
    using calls = std::vector<std::string>;

    host node;
    std::shared_ptr<link> one = std::make_shared<link>(node.turns);
    std::shared_ptr<link> two = std::make_shared<link>(node.turns);
};

} // namespace
} // namespace turns

BOOST_FIXTURE_TEST_SUITE(turns, fixture)

BOOST_AUTO_TEST_CASE(one_turn_flushes_all_that_wait_each_once) {
    node.turns.flush_soon(*one);
    node.turns.flush_soon(*two);
    node.turns.flush_soon(*one);
    BOOST_TEST(node.posted == 1);
    BOOST_TEST(one->done.empty());
    take_turns();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
    BOOST_TEST(node.routed == 1);
    BOOST_TEST(node.settled == 1);
}

BOOST_AUTO_TEST_CASE(what_waits_again_while_it_is_flushed_has_another_turn) {
    one->during = [&] { node.turns.flush_soon(*one); };
    node.turns.flush_soon(*one);
    --node.posted;
    node.turns.turn();
    BOOST_TEST(one->done.size() == 1U);
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(what_one_throws_keeps_nothing_from_the_others) {
    one->during = [] { throw std::runtime_error{"a handler's"}; };
    node.turns.flush_soon(*one);
    node.turns.flush_soon(*two);
    --node.posted;
    BOOST_CHECK_THROW(node.turns.turn(), std::runtime_error);
    take_turns();
    BOOST_TEST(two->done.size() == 1U);
    node.turns.flush_soon(*one); // it is not taken for one that waits
    take_turns();
    BOOST_TEST(one->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(who_asks_alone_is_written_in_the_call_and_no_turn_is_posted) {
    one->alone = true;
    node.turns.let([&] { node.turns.flush_soon(*one); });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(node.posted == 0);
}

BOOST_AUTO_TEST_CASE(what_is_more_than_writing_and_who_does_not_ask_alone_wait_for_the_turn) {
    one->alone = true;
    one->takes_all = false;
    node.turns.let([&] {
        node.turns.flush_soon(*one);
        node.turns.flush_soon(*two);
    });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(two->done.empty());
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done == (calls{"write", "flush"}), boost::test_tools::per_element());
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(others_may_begin_to_wait_while_one_is_written) {
    for (const bool takes_all : {true, false}) {
        one->alone = true;
        one->takes_all = takes_all;
        one->during = [&] {
            node.turns.flush_soon(*two);
            node.turns.flush_soon(*one);
        };
        node.turns.let([&] { node.turns.flush_soon(*one); });
        take_turns();
        BOOST_TEST(one->done == (calls{"write", "flush"}), boost::test_tools::per_element());
        BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
        one->done.clear();
        two->done.clear();
    }
}

BOOST_AUTO_TEST_CASE(what_throws_while_it_is_written_keeps_nothing_from_the_others) {
    one->alone = two->alone = true;
    one->during = [] { throw std::runtime_error{"a log's"}; };
    const auto say = [&] {
        node.turns.flush_soon(*one);
        node.turns.flush_soon(*two);
    };
    BOOST_CHECK_THROW(node.turns.let(say), std::runtime_error);
    BOOST_TEST(two->done.empty());
    take_turns();
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(several_of_each_cycle_are_written_together_once_that_is_known) {
    bind("speed");
    bind("course");
    for (int cycle = 0; cycle < 3; ++cycle) {
        one->done.clear();
        update("speed");
        BOOST_TEST(one->done.size() == (cycle == 0 ? 1U : 0U));
        update("course");
        node.node.clock.advance(std::chrono::milliseconds{5}); // the turn is late
        take_turns();
        BOOST_TEST(one->done == (cycle == 0 ? calls{"write", "flush"} : calls{"flush"}),
                   boost::test_tools::per_element());
        BOOST_TEST(one->updates == 2U * (static_cast<unsigned>(cycle) + 1));
        node.node.clock.advance(std::chrono::milliseconds{5});
    }
}

BOOST_AUTO_TEST_CASE(what_nobody_is_bound_to_is_not_one_of_several) {
    bind("speed");
    for (int cycle = 0; cycle < 3; ++cycle) {
        one->done.clear();
        update("course");
        update("speed");
        BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
        BOOST_TEST(node.posted == 0);
        node.node.clock.advance(std::chrono::milliseconds{10});
    }
}

BOOST_AUTO_TEST_CASE(what_throws_while_it_says_something_leaves_what_was_said_to_the_turn) {
    one->alone = true;
    const auto say = [&] {
        node.turns.flush_soon(*one);
        throw std::runtime_error{"a converter's"};
    };
    BOOST_CHECK_THROW(node.turns.let(say), std::runtime_error);
    BOOST_TEST(one->done.empty());
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done.size() == 1U);
}

BOOST_AUTO_TEST_CASE(while_a_handler_runs_and_where_a_turn_is_due_nothing_is_written_in_the_call) {
    one->alone = true;
    {
        const core::turns::serving during{node.turns};
        node.turns.let([&] { node.turns.flush_soon(*one); });
    }
    BOOST_TEST(one->done.empty());
    two->alone = true;
    node.turns.let([&] { node.turns.flush_soon(*two); });
    BOOST_TEST(two->done.empty());
    take_turns();
    BOOST_TEST(one->done.size() + two->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(whoever_is_stopped_has_no_more_turns) {
    one->during = [&] { node.turns.flush_soon(*two); };
    node.turns.flush_soon(*one);
    node.is_stopped = true;
    node.turns.stop();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
    take_turns();
    BOOST_TEST(two->done.empty());
    BOOST_TEST(node.routed == 0);
}

BOOST_AUTO_TEST_SUITE_END()
