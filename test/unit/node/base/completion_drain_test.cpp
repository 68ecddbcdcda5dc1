// SPDX-License-Identifier: BSL-1.0
#include "asio/asio_environment.hpp"
#include "node/base/completion_queue.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/test/unit_test.hpp>

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace completion_drain_test {
namespace {

using cles::core::completion_drain;

struct fixture {
    void put(std::function<void()> function) {
        drain->put(cles::core::completion{cles::core::completion::callback{std::move(function)}});
    }
    void put(char name) {
        put([this, name] { called += name; });
    }

    std::string called;
    boost::asio::io_context io;
    std::shared_ptr<completion_drain> drain =
        std::make_shared<completion_drain>(std::make_shared<cles::asio_port::asio_environment>(io.get_executor()));
};

} // namespace
} // namespace completion_drain_test

BOOST_FIXTURE_TEST_SUITE(completion_drain, completion_drain_test::fixture)

BOOST_AUTO_TEST_CASE(completions_are_called_later_and_in_order) {
    put('a');
    put([this] {
        called += 'b';
        put('d');
        called += 'B';
    });
    put('c');
    BOOST_TEST(called.empty());
    io.run();
    BOOST_TEST(called == "abBcd");
}

BOOST_AUTO_TEST_CASE(other_functions_of_the_executor_run_after_eight) {
    static_assert(cles::core::completion_drain::max_at_once == 8);
    std::function<void()> again = [&] {
        called += '.';
        if (called.size() < 20) {
            put(again);
        }
    };
    put(again);
    boost::asio::post(io, [this] { called += '|'; });
    io.run();
    BOOST_TEST(called.substr(0, 9) == "........|");
}

BOOST_AUTO_TEST_CASE(an_exception_leaves_run_and_the_others_are_called) {
    put('a');
    put([] { throw std::runtime_error{"by a handler"}; });
    put('b');
    put([] { throw std::runtime_error{"by a handler"}; });
    BOOST_CHECK_THROW(io.run(), std::runtime_error);
    BOOST_TEST(called == "a");
    BOOST_CHECK_THROW(io.run(), std::runtime_error);
    BOOST_TEST(called == "ab");
    io.run();
    put('c');
    io.restart();
    io.run();
    BOOST_TEST(called == "abc");
}

BOOST_AUTO_TEST_CASE(one_that_runs_the_executor_gets_the_others_called) {
    put([this] {
        put('b');
        io.poll();
        called += 'a';
    });
    put('c');
    io.run();
    BOOST_TEST(called == "cba");
}

BOOST_AUTO_TEST_CASE(they_are_called_after_their_queue_is_destroyed) {
    put([this] { drain.reset(); });
    put('a');
    io.run();
    BOOST_TEST(called == "a");
}

BOOST_AUTO_TEST_CASE(they_are_destroyed_with_their_context_even_if_they_own_the_queue) {
    const auto owned = std::make_shared<int>();
    std::weak_ptr<cles::core::completion_drain> queue;
    {
        boost::asio::io_context other;
        const auto own = std::make_shared<cles::core::completion_drain>(
            std::make_shared<cles::asio_port::asio_environment>(other.get_executor()));
        queue = own;
        own->put(cles::core::completion{cles::core::completion::callback{[own, owned] {}}});
        BOOST_TEST(owned.use_count() == 2);
    }
    BOOST_TEST(owned.use_count() == 1);
    BOOST_TEST(queue.expired());
}

BOOST_AUTO_TEST_SUITE_END()
