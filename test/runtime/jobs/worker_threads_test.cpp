// SPDX-License-Identifier: BSL-1.0
#include "jobs/worker_threads.hpp"
#include "support/run_until.hpp"

#include <boost/asio/post.hpp>
#include <boost/test/unit_test.hpp>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <thread>

BOOST_AUTO_TEST_SUITE(worker_threads)

using namespace std::chrono_literals;
using cles::test::patience;
using threads = cles::runtime::worker_threads;

std::shared_future<void> as_gate(std::promise<void>& opener) { return opener.get_future().share(); }

// A thread that only waits for a gate.
std::future<void> occupy(threads& on, std::shared_future<void> gate) {
    const auto entered = std::make_shared<std::promise<void>>();
    boost::asio::post(on.get_executor(), [entered, gate] {
        entered->set_value();
        gate.wait();
    });
    return entered->get_future();
}

BOOST_AUTO_TEST_CASE(posted_functions_run_on_the_threads) {
    threads two{2};
    std::promise<std::thread::id> where;
    boost::asio::post(two.get_executor(), [&] { where.set_value(std::this_thread::get_id()); });
    BOOST_TEST((where.get_future().get() != std::this_thread::get_id()));
    BOOST_TEST(two.stop(patience) == 0U);
}

BOOST_AUTO_TEST_CASE(threads_run_concurrently_and_can_be_added) {
    std::promise<void> opener;
    const auto gate = as_gate(opener);
    threads one{1};
    occupy(one, gate).wait();
    auto second = occupy(one, gate);
    one.add();
    BOOST_TEST(one.count() == 2U);
    BOOST_TEST((second.wait_for(patience) == std::future_status::ready));
    opener.set_value();
    BOOST_TEST(one.stop(patience) == 0U);
}

BOOST_AUTO_TEST_CASE(a_thread_that_does_not_return_is_abandoned) {
    std::promise<void> opener;
    const auto gate = as_gate(opener);
    const auto over = std::make_shared<std::promise<void>>();
    {
        threads one{1};
        std::promise<void> entered;
        boost::asio::post(one.get_executor(), [&entered, gate, over] {
            entered.set_value();
            gate.wait();
            over->set_value();
        });
        entered.get_future().wait();
        BOOST_TEST(one.stop(1ms, 1) == 1U);
        BOOST_TEST(one.stop(1ms, 1) == 0U); // expected
    }
    opener.set_value();
    BOOST_TEST((over->get_future().wait_for(patience) == std::future_status::ready));
}

BOOST_AUTO_TEST_CASE(functions_not_started_before_stop_never_run) {
    std::promise<void> opener;
    const auto gate = as_gate(opener);
    const auto ran = std::make_shared<std::atomic<bool>>(false);
    const auto discarded = std::make_shared<std::promise<void>>();
    {
        threads one{1};
        occupy(one, gate).wait();
        std::shared_ptr<void> held{nullptr, [discarded](void*) { discarded->set_value(); }};
        boost::asio::post(one.get_executor(), [ran, held = std::move(held)] { *ran = true; });
        BOOST_TEST(one.stop(1ms, 1) == 1U);
    }
    opener.set_value();
    BOOST_TEST((discarded->get_future().wait_for(patience) == std::future_status::ready));
    BOOST_TEST(!*ran);
}

BOOST_AUTO_TEST_SUITE_END()
