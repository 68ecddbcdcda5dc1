// SPDX-License-Identifier: BSL-1.0
#include "jobs/stop_notifier.hpp"
#include "support/gate.hpp"

#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

BOOST_AUTO_TEST_SUITE(stop_notifier)

using namespace std::chrono_literals;
using cles::log_level;
using cles::test::gate;
using notifier = cles::runtime::stop_notifier;

template <class Condition>
void wait_until(Condition&& holds) {
    while (!holds()) {
        std::this_thread::yield();
    }
}

// The log.
struct journal {
    void add(log_level level, const std::string& text) {
        const std::scoped_lock lock{mutex};
        lines.push_back((level == log_level::error ? "error: " : "warning: ") + text);
    }
    [[nodiscard]] std::size_t count(const std::string& piece) const {
        const std::scoped_lock lock{mutex};
        std::size_t found = 0;
        for (const auto& line : lines) {
            found += line.find(piece) != std::string::npos ? 1 : 0;
        }
        return found;
    }
    mutable std::mutex mutex;
    std::vector<std::string> lines;
};

BOOST_AUTO_TEST_CASE(callbacks_run_in_order_on_one_other_thread) {
    notifier stops{1min};
    std::atomic<int> calls{0};
    std::atomic<bool> in_order{true};
    std::atomic<bool> here{false};
    for (int i = 0; i < 10; ++i) {
        stops.notify({.callback = [&, i, io = std::this_thread::get_id()] {
            in_order = in_order && calls == i;
            here = here || std::this_thread::get_id() == io;
            ++calls;
        }});
    }
    wait_until([&] { return calls == 10; });
    BOOST_TEST(in_order);
    BOOST_TEST(!here);
    BOOST_TEST(stops.close(1min) == 0U);
}

BOOST_AUTO_TEST_CASE(closing_without_calls_returns_at_once) {
    notifier stops;
    BOOST_TEST(stops.close(0ms) == 0U);
    BOOST_TEST(!stops.notify({.callback = [] {}}));
}

BOOST_AUTO_TEST_CASE(all_callbacks_run_before_close_returns) {
    for (int i = 0; i < 50; ++i) {
        std::atomic<int> calls{0};
        notifier stops{1min}; // a thread that gets no processor for a while is not taken for one that blocks
        stops.notify({.callback = [&] { ++calls; }});
        stops.notify({.callback = [&] { ++calls; }});
        BOOST_TEST(stops.close(i % 2 == 0 ? 1min : 0ms) == 0U);
        BOOST_TEST(calls == 2);
    }
}

BOOST_AUTO_TEST_CASE(a_blocking_callback_is_reported_and_delays_no_other) {
    const auto log = std::make_shared<journal>();
    const auto held = std::make_shared<gate>();
    std::atomic<int> calls{0};
    notifier stops;
    for (int i = 0; i < 5; ++i) {
        stops.notify({.callback = [held] { held->pass(); },
                      .log = [log](log_level level, const std::string& text) { log->add(level, text); }});
        stops.notify({.callback = [&] { ++calls; }});
    }
    wait_until([&] { return calls == 5; });
    BOOST_TEST(held->passed() == 0);
    wait_until([&] { return log->count("warning: its on_stop callback does not return") >= 4; });
    // Threads that return continue.
    held->open();
    wait_until([&] { return held->passed() == 5; });
    stops.notify({.callback = [&] { ++calls; }});
    wait_until([&] { return calls == 6; });
    BOOST_TEST(stops.close(1min) == 0U);
}

BOOST_AUTO_TEST_CASE(threads_are_bounded_and_exhaustion_is_reported_once) {
    const auto log = std::make_shared<journal>();
    const auto held = std::make_shared<gate>();
    std::atomic<int> calls{0};
    notifier stops{1ms};
    for (std::size_t i = 0; i < notifier::max_threads + 4; ++i) {
        stops.notify({.callback = [held] { held->pass(); },
                      .log = [log](log_level level, const std::string& text) { log->add(level, text); }});
    }
    stops.notify({.callback = [&] { ++calls; }});
    wait_until([&] { return held->arrived() == static_cast<int>(notifier::max_threads); });
    wait_until([&] { return log->count("error: ") == 1; });
    BOOST_TEST(calls == 0);
    held->open();
    wait_until([&] { return calls == 1; });
    wait_until([&] { return held->passed() == static_cast<int>(notifier::max_threads) + 4; });
    BOOST_TEST(stops.close(1min) == 0U);
    BOOST_TEST(log->count("error: ") == 1U);
}

BOOST_AUTO_TEST_CASE(a_throwing_callback_is_reported) {
    const auto log = std::make_shared<journal>();
    notifier stops;
    stops.notify({.callback = [] { throw std::runtime_error{"no"}; },
                  .log = [log](log_level level, const std::string& text) { log->add(level, text); }});
    BOOST_TEST(stops.close(1min) == 0U);
    BOOST_TEST(log->count("warning: its on_stop callback threw") == 1U);
}

BOOST_AUTO_TEST_CASE(calls_not_made_before_close_are_dropped) {
    const auto held = std::make_shared<gate>();
    const auto token = std::make_shared<int>(0);
    {
        notifier stops{1ms};
        for (std::size_t i = 0; i < notifier::max_threads; ++i) {
            stops.notify({.callback = [held] { held->pass(); }});
        }
        wait_until([&] { return held->arrived() == static_cast<int>(notifier::max_threads); });
        stops.notify({.callback = [token] {}});
        BOOST_TEST(token.use_count() == 2);
        BOOST_TEST(stops.close(0ms) == notifier::max_threads);
        BOOST_TEST(token.use_count() == 1);
    }
    held->open();
    wait_until([&] { return held->passed() == static_cast<int>(notifier::max_threads); });
}

BOOST_AUTO_TEST_CASE(a_callback_that_does_not_return_is_abandoned) {
    const auto held = std::make_shared<gate>();
    {
        notifier stops;
        stops.notify({.callback = [held] { held->pass(); }});
        wait_until([&] { return held->arrived() == 1; });
        BOOST_TEST(stops.close(0ms) == 1U);
    }
    held->open();
    wait_until([&] { return held->passed() == 1; }); // its state still exists
}

BOOST_AUTO_TEST_SUITE_END()
