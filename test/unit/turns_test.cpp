// SPDX-License-Identifier: BSL-1.0
#include "core/turns.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace cles::test;
namespace core = cles::core;

struct link final : core::turn_taker, std::enable_shared_from_this<link> {
    void flush() override { act("flush"); }
    bool write() override {
        act("write");
        return takes_all;
    }
    bool asks_alone() override { return alone; }
    std::shared_ptr<core::turn_taker> share() override { return shared_from_this(); }
    void act(const std::string& what) {
        done.push_back(what);
        if (during) {
            std::exchange(during, nullptr)();
        }
    }

    std::vector<std::string> done;
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
    using calls = std::vector<std::string>;

    host node;
    std::shared_ptr<link> one = std::make_shared<link>();
    std::shared_ptr<link> two = std::make_shared<link>();
};

} // namespace

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
