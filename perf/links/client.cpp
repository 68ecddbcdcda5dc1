// SPDX-License-Identifier: BSL-1.0
#include <cles/multicast.hpp>
#include <cles/service.hpp>

#include "ends.hpp"
#include "perf/baseline/exchange.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/support/bare_socket.hpp"
#include "timed_sample.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <thread>
#include <utility>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

using clock_type = std::chrono::steady_clock;
constexpr std::size_t ignored_results = 5;

double microseconds_since(clock_type::time_point began) {
    return std::chrono::duration<double, std::micro>(clock_type::now() - began).count();
}

void check(const localization& value) {
    if (!is_sample(value)) {
        throw std::runtime_error("the received values are not those that were sent");
    }
}

/// When to send the next request: at fixed intervals, or at once if the last answer was late.
clock_type::time_point after(clock_type::time_point last, pace how) {
    return std::max(last + how.interval, clock_type::now());
}

asio::awaitable<void> ask_for_pulls(cles::service& client, pace how, std::vector<double>& times) {
    asio::steady_timer timer{client.get_executor()};
    auto began = clock_type::now();
    for (std::size_t i = 0; i < ignored_results + how.count; ++i) {
        timer.expires_at(after(began, how));
        co_await timer.async_wait(asio::use_awaitable);
        began = clock_type::now();
        const auto value = co_await client.async_pull<localization>("car1:localization");
        const double took = microseconds_since(began);
        check(value);
        if (i >= ignored_results) {
            times.push_back(took);
        }
    }
}

asio::awaitable<void> take_updates(cles::service& client, cles::bind_options binding, pace how,
                                   std::vector<double>& ages) {
    auto feed = co_await client.async_bind<localization>("car1:localization", binding);
    for (std::size_t taken = 0; taken < ignored_results + how.count;) {
        const auto item = co_await feed.async_next();
        if (item.kind == feed_event::lost) {
            throw std::runtime_error("the publisher was lost: " + item.text);
        }
        if (item.kind == feed_event::update && taken++ >= ignored_results) {
            ages.push_back(age_of(item.value));
        }
    }
}

/// Runs the coroutine that `work` returns, with a client with these options.
template <class F>
void by_cles(cles::service_options setup, F work) {
    asio::io_context io{1};
    setup.name = "asker";
    cles::service client{io, setup};
    std::exception_ptr failure;
    asio::co_spawn(io, work(client), [&](std::exception_ptr ended_by) {
        failure = std::move(ended_by);
        client.stop();
    });
    io.run();
    if (failure) {
        std::rethrow_exception(failure);
    }
}

} // namespace

std::vector<double> time_pulls_by_hand(const std::string& url, pace how) {
    icd::client client{parse_url(url)};
    std::vector<double> times;
    auto began = clock_type::now();
    for (std::size_t i = 0; i < ignored_results + how.count; ++i) {
        std::this_thread::sleep_until(after(began, how));
        began = clock_type::now();
        const auto value = client.pull();
        const double took = microseconds_since(began);
        check(value);
        if (i >= ignored_results) {
            times.push_back(took);
        }
    }
    return times;
}

std::vector<double> time_updates_by_hand(const std::string& url, pace how) {
    const auto socket = connect_to(parse_url(url));
    std::vector<double> ages;
    for (std::size_t i = 0; i < ignored_results + how.count; ++i) {
        icd::reply_bytes bytes;
        if (!receive_all(socket.get(), bytes)) {
            throw std::runtime_error("the hand-written publisher closed the connection");
        }
        const auto value = icd::unpack_reply(bytes);
        if (!value) {
            throw std::runtime_error("the hand-written publisher sent something that is not a packet");
        }
        if (i >= ignored_results) {
            ages.push_back(age_of(*value));
        }
    }
    return ages;
}

std::vector<double> time_pulls(const std::string& url, pace how) {
    std::vector<double> times;
    by_cles({.peers = {{"car1", url}}}, [&](cles::service& client) { return ask_for_pulls(client, how, times); });
    return times;
}

std::vector<double> time_updates(const std::string& url, pace how) {
    std::vector<double> ages;
    by_cles({.peers = {{"car1", url}}}, [&](cles::service& client) { return take_updates(client, {}, how, ages); });
    return ages;
}

std::vector<double> time_updates_by_multicast(const std::string& group, pace how) {
    std::vector<double> ages;
    by_cles({.insecure = true, .multicast = parse_multicast(group)},
            [&](cles::service& client) { return take_updates(client, cles::bind_options{}.multicast(), how, ages); });
    return ages;
}

} // namespace cles::perf
