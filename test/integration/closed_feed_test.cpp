// SPDX-License-Identifier: BSL-1.0
// A feed that is not open returns an error, and none of its operations completes inside a call.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/bind_executor.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <exception>
#include <future>
#include <ostream>
#include <utility>

namespace closed_feed_test {

using namespace cles::test;
using cles::errc;
namespace asio = boost::asio;
using feed = cles::feed<int>;
using item = cles::feed_item<int>;

enum class how : std::uint8_t { made_by_default, closed, moved_from, never_bound };
constexpr std::array every_how{how::made_by_default, how::closed, how::moved_from, how::never_bound};
std::ostream& operator<<(std::ostream& out, how h) {
    constexpr std::array names{"made_by_default", "closed", "moved_from", "never_bound"};
    return out << names[static_cast<std::size_t>(h)];
}

struct fixture {
    fixture() { car.on_bind("place"); }
    feed bind(const char* noun) {
        feed made;
        int calls = 0;
        tower.async_bind<int>(noun, [&](boost::system::error_code, feed bound) {
            made = std::move(bound);
            ++calls;
        });
        run_until(io, [&] { return calls == 1; });
        return made;
    }
    void shut(feed& one, how h) {
        if (h == how::closed) {
            one = bind("car1:place");
            one.close();
        } else if (h == how::moved_from) {
            one = bind("car1:place");
            elsewhere = std::move(one);
        } else if (h == how::never_bound) {
            one = bind("car1:nothing");
        }
    }

    asio::io_context io;
    cles::service car{io, listening("car1")};
    cles::service tower{io, knowing("tower", car)};
    feed elsewhere;
};

asio::awaitable<int> next_of(feed& one) {
    const auto next = co_await one.async_next();
    co_return next.value;
}

} // namespace closed_feed_test

BOOST_FIXTURE_TEST_SUITE(closed_feed, closed_feed_test::fixture)

using namespace closed_feed_test;
namespace data = boost::unit_test::data;

CLES_DATA_TEST_CASE(a_callback_is_called, every_how, h) {
    feed one;
    shut(one, h);
    BOOST_TEST(!one.is_open());
    int calls = 0;
    boost::system::error_code code;
    one.async_next(asio::bind_executor(io, [&](boost::system::error_code failed, const item&) {
        ++calls;
        code = failed;
    }));
    BOOST_TEST(calls == 0);
    run_until(io, [&] { return calls == 1; });
    BOOST_TEST(code == errc::closed);
}

CLES_DATA_TEST_CASE(a_coroutine_gets_an_exception, every_how, h) {
    feed one;
    shut(one, h);
    std::exception_ptr thrown;
    bool ended = false;
    asio::co_spawn(io, next_of(one), [&](std::exception_ptr e, int) {
        thrown = std::move(e);
        ended = true;
    });
    run_until(io, [&] { return ended; });
    BOOST_REQUIRE(thrown);
    BOOST_CHECK_EXCEPTION(std::rethrow_exception(thrown), cles::error,
                          [](const cles::error& e) { return e.code() == errc::closed; });
}

CLES_DATA_TEST_CASE(so_does_a_future, every_how, h) {
    feed one;
    shut(one, h);
    auto result = one.async_next(asio::use_future);
    run_ready(io);
    BOOST_CHECK_THROW(result.get(), cles::error);
}

// If it had a service, its handler runs there.
BOOST_AUTO_TEST_CASE(a_handler_without_an_executor_runs_on_the_services) {
    auto one = bind("car1:place");
    one.close();
    int calls = 0;
    one.async_next([&](boost::system::error_code failed, const item&) {
        BOOST_TEST(failed == errc::closed);
        BOOST_TEST(io.get_executor().running_in_this_thread());
        ++calls;
    });
    run_until(io, [&] { return calls == 1; });
}

BOOST_AUTO_TEST_CASE(closing_and_destroying_call_no_handler) {
    int calls = 0;
    const auto take = [&](boost::system::error_code failed, const item&) {
        BOOST_TEST(failed == errc::cancelled);
        ++calls;
    };
    auto closed = bind("car1:place");
    closed.async_next(take);
    closed.close();
    BOOST_TEST(calls == 0);
    {
        auto gone = bind("car1:place/1");
        gone.async_next(take);
    }
    {
        auto replaced = bind("car1:place/2");
        replaced.async_next(take);
        const int before = calls;
        replaced = feed{};
        BOOST_TEST(calls == before);
    }
    run_until(io, [&] { return calls == 3; });
}

BOOST_AUTO_TEST_CASE(a_feed_may_be_assigned_to_itself) {
    auto one = bind("car1:place");
    auto& same = one;
    one = std::move(same);
    BOOST_TEST(one.is_open());
}

BOOST_AUTO_TEST_SUITE_END()
