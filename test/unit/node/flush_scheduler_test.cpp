// SPDX-License-Identifier: BSL-1.0
#include "node/flush_scheduler.hpp"
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

namespace flush_scheduler {
namespace {

using namespace cles::test;
namespace core = cles::core;

struct link final : core::flushable, core::subscriber, std::enable_shared_from_this<link> {
    explicit link(core::flush_scheduler& all) : flush_scheduler(all) {}
    void flush() override { act("flush"); }
    bool write() override {
        act("write");
        return takes_all;
    }
    bool has_single_request() override { return alone; }
    bool has_single_message() override { return alone; }
    std::shared_ptr<core::flushable> share() override { return shared_from_this(); }
    [[nodiscard]] bool takes_updates() const override { return true; }
    void put_updates(std::string_view lines) override {
        updates += static_cast<std::size_t>(std::ranges::count(lines, '\n'));
        flush_scheduler.flush_soon(*this);
    }
    void act(const std::string& what) {
        done.push_back(what);
        if (during) {
            std::exchange(during, nullptr)();
        }
    }

    core::flush_scheduler& flush_scheduler;
    std::vector<std::string> done;
    std::size_t updates = 0;
    std::function<void()> during; // once
    bool takes_all = true;
    bool alone = false;
};

struct host final : core::flush_host {
    void post_flush() override { ++posted; }
    [[nodiscard]] bool stopped() const override { return is_stopped; }
    [[nodiscard]] core::node_state& node() noexcept { return *inner.host; }
    void drain_routing(cles::time_point) override { ++routed; }
    void check_shutdown() override { ++shutdown_checks; }

    test_node inner;
    core::flush_scheduler flush_scheduler{*this, *inner.host};
    int posted = 0;
    int routed = 0;
    int shutdown_checks = 0;
    bool is_stopped = false;
};

struct fixture {
    // Runs those that were posted, until there is none.
    void take_turns() {
        while (node.posted != 0) {
            --node.posted;
            node.flush_scheduler.turn();
        }
    }
    void update(const std::string& noun) {
        node.flush_scheduler.run_user_call([&] { node.inner.publish(noun, "1"); });
    }
    void bind(const std::string& noun) { node.node().published.open(noun).bind(*one, {}); }
    using calls = std::vector<std::string>;

    host node;
    std::shared_ptr<link> one = std::make_shared<link>(node.flush_scheduler);
    std::shared_ptr<link> two = std::make_shared<link>(node.flush_scheduler);
};

} // namespace
} // namespace flush_scheduler

BOOST_FIXTURE_TEST_SUITE(flush_scheduler, fixture)

BOOST_AUTO_TEST_CASE(one_turn_flushes_everything_that_waits_once) {
    node.flush_scheduler.flush_soon(*one);
    node.flush_scheduler.flush_soon(*two);
    node.flush_scheduler.flush_soon(*one);
    BOOST_TEST(node.posted == 1);
    BOOST_TEST(one->done.empty());
    take_turns();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
    BOOST_TEST(node.routed == 1);
    BOOST_TEST(node.shutdown_checks == 1);
}

BOOST_AUTO_TEST_CASE(an_object_that_asks_again_during_its_flush_is_flushed_again) {
    one->during = [&] { node.flush_scheduler.flush_soon(*one); };
    node.flush_scheduler.flush_soon(*one);
    --node.posted;
    node.flush_scheduler.turn();
    BOOST_TEST(one->done.size() == 1U);
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(an_exception_of_one_does_not_affect_the_others) {
    one->during = [] { throw std::runtime_error{"a handler's"}; };
    node.flush_scheduler.flush_soon(*one);
    node.flush_scheduler.flush_soon(*two);
    --node.posted;
    BOOST_CHECK_THROW(node.flush_scheduler.turn(), std::runtime_error);
    take_turns();
    BOOST_TEST(two->done.size() == 1U);
    node.flush_scheduler.flush_soon(*one); // it no longer counts as waiting
    take_turns();
    BOOST_TEST(one->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(a_single_request_is_written_in_the_call_without_a_turn) {
    one->alone = true;
    node.flush_scheduler.run_user_call([&] { node.flush_scheduler.flush_soon(*one); });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(node.posted == 0);
}

BOOST_AUTO_TEST_CASE(serving_and_further_requests_wait_for_the_turn) {
    one->alone = true;
    one->takes_all = false;
    node.flush_scheduler.run_user_call([&] {
        node.flush_scheduler.flush_soon(*one);
        node.flush_scheduler.flush_soon(*two);
    });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(two->done.empty());
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done == (calls{"write", "flush"}), boost::test_tools::per_element());
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(others_may_ask_for_a_flush_while_one_is_written) {
    for (const bool takes_all : {true, false}) {
        one->alone = true;
        one->takes_all = takes_all;
        one->during = [&] {
            node.flush_scheduler.flush_soon(*two);
            node.flush_scheduler.flush_soon(*one);
        };
        node.flush_scheduler.run_user_call([&] { node.flush_scheduler.flush_soon(*one); });
        take_turns();
        BOOST_TEST(one->done == (calls{"write", "flush"}), boost::test_tools::per_element());
        BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
        one->done.clear();
        two->done.clear();
    }
}

BOOST_AUTO_TEST_CASE(a_message_that_is_forwarded_alone_is_written_after_its_line_without_a_turn) {
    one->alone = true;
    node.flush_scheduler.run_line([&] { node.flush_scheduler.flush_soon(*one); }, [] { return true; });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(node.posted == 0);
}

BOOST_AUTO_TEST_CASE(other_messages_wait_for_the_turn) {
    one->alone = true;
    node.flush_scheduler.run_line(
        [&] {
            node.flush_scheduler.flush_soon(*one);
            node.flush_scheduler.flush_soon(*two); // where more is in progress
        },
        [] { return true; });
    BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
    // The link of the line has something to write first.
    node.flush_scheduler.run_line([&] { node.flush_scheduler.flush_soon(*one); }, [] { return false; });
    BOOST_TEST(one->done.size() == 1U);
    take_turns();
    BOOST_TEST(one->done == (calls{"write", "flush"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_turn_that_is_posted_while_a_line_is_processed_is_taken) {
    node.flush_scheduler.run_line([&] { node.flush_scheduler.schedule_turn(); }, [] { return true; });
    BOOST_TEST(node.posted == 1);
    one->alone = true; // until then, what waits goes with it
    node.flush_scheduler.run_line([&] { node.flush_scheduler.flush_soon(*one); }, [] { return true; });
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_exception_in_a_line_leaves_the_rest_for_the_turn) {
    const auto fails = [&] {
        node.flush_scheduler.flush_soon(*one);
        throw std::runtime_error{"a handler's"};
    };
    BOOST_CHECK_THROW(node.flush_scheduler.run_line(fails, [] { return true; }), std::runtime_error);
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_exception_during_a_write_does_not_affect_the_others) {
    one->alone = two->alone = true;
    one->during = [] { throw std::runtime_error{"a log's"}; };
    const auto say = [&] {
        node.flush_scheduler.flush_soon(*one);
        node.flush_scheduler.flush_soon(*two);
    };
    BOOST_CHECK_THROW(node.flush_scheduler.run_user_call(say), std::runtime_error);
    BOOST_TEST(two->done.empty());
    take_turns();
    BOOST_TEST(two->done == calls{"flush"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(several_updates_of_each_cycle_are_coalesced_once_the_cycle_is_known) {
    bind("speed");
    bind("course");
    for (int cycle = 0; cycle < 3; ++cycle) {
        one->done.clear();
        update("speed");
        BOOST_TEST(one->done.size() == (cycle == 0 ? 1U : 0U));
        update("course");
        node.inner.clock.advance(std::chrono::milliseconds{5}); // the turn is late
        take_turns();
        BOOST_TEST(one->done == (cycle == 0 ? calls{"write", "flush"} : calls{"flush"}),
                   boost::test_tools::per_element());
        BOOST_TEST(one->updates == 2U * (static_cast<unsigned>(cycle) + 1));
        node.inner.clock.advance(std::chrono::milliseconds{5});
    }
}

BOOST_AUTO_TEST_CASE(updates_without_subscribers_do_not_count) {
    bind("speed");
    for (int cycle = 0; cycle < 3; ++cycle) {
        one->done.clear();
        update("course");
        update("speed");
        BOOST_TEST(one->done == calls{"write"}, boost::test_tools::per_element());
        BOOST_TEST(node.posted == 0);
        node.inner.clock.advance(std::chrono::milliseconds{10});
    }
}

BOOST_AUTO_TEST_CASE(output_before_an_exception_is_written_in_the_turn) {
    one->alone = true;
    const auto say = [&] {
        node.flush_scheduler.flush_soon(*one);
        throw std::runtime_error{"a converter's"};
    };
    BOOST_CHECK_THROW(node.flush_scheduler.run_user_call(say), std::runtime_error);
    BOOST_TEST(one->done.empty());
    BOOST_TEST(node.posted == 1);
    take_turns();
    BOOST_TEST(one->done.size() == 1U);
}

BOOST_AUTO_TEST_CASE(nothing_is_written_in_the_call_during_a_handler_or_before_a_turn) {
    one->alone = true;
    {
        const auto during = node.flush_scheduler.serving();
        node.flush_scheduler.run_user_call([&] { node.flush_scheduler.flush_soon(*one); });
    }
    BOOST_TEST(one->done.empty());
    two->alone = true;
    node.flush_scheduler.run_user_call([&] { node.flush_scheduler.flush_soon(*two); });
    BOOST_TEST(two->done.empty());
    take_turns();
    BOOST_TEST(one->done.size() + two->done.size() == 2U);
}

BOOST_AUTO_TEST_CASE(there_are_no_turns_after_stop) {
    one->during = [&] { node.flush_scheduler.flush_soon(*two); };
    node.flush_scheduler.flush_soon(*one);
    node.is_stopped = true;
    node.flush_scheduler.stop();
    BOOST_TEST(one->done == calls{"flush"}, boost::test_tools::per_element());
    take_turns();
    BOOST_TEST(two->done.empty());
    BOOST_TEST(node.routed == 0);
}

BOOST_AUTO_TEST_SUITE_END()
