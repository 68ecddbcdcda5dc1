// SPDX-License-Identifier: BSL-1.0
// Updates that other threads publish.

#include <cles/service.hpp>

#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace publisher {
namespace {

using namespace cles::test;
using int_feed = cles::feed<int>;

struct fixture {
    void bind(std::uint32_t keep = 64) {
        node->async_bind<int>("self:count", cles::bind_options{}.keep(keep),
                              [this](boost::system::error_code code, int_feed bound) {
                                  BOOST_REQUIRE(!code);
                                  feed = std::make_shared<int_feed>(std::move(bound));
                                  next();
                              });
        run_until(io, [&] { return feed != nullptr; });
    }
    void next() {
        feed->async_next([this](boost::system::error_code code, const auto& event) {
            if (code) {
                return;
            }
            if (event.kind == cles::feed_event::update) {
                got.push_back(event.value);
            }
            next();
        });
    }
    bool was_said(const std::string& part) {
        const std::scoped_lock lock{mutex};
        return said.find(part) != std::string::npos;
    }

    std::mutex mutex;
    std::string said;
    boost::asio::io_context io;
    std::optional<cles::service> node{std::in_place, io,
                                      cles::service_options{.name = "node", .log = [this](cles::log_level, auto text) {
                                                                const std::scoped_lock lock{mutex};
                                                                said += std::string{text} + "\n";
                                                            }}};
    cles::publisher updates = node->make_publisher();
    std::shared_ptr<int_feed> feed;
    std::vector<int> got;
};

/// A value that counts how often it is written.
struct counted {
    int* writes = nullptr;
};

} // namespace
} // namespace publisher

template <>
struct cles::converter<::publisher::counted> {
    static constexpr bool is_scalar = true;
    static void write(json_writer& w, const ::publisher::counted& value) {
        w.value(static_cast<std::int64_t>(++*value.writes));
    }
    static bool read(json_reader& r, ::publisher::counted&) { return r.skip(); }
};

BOOST_FIXTURE_TEST_SUITE(publisher, fixture)

BOOST_AUTO_TEST_CASE(they_arrive_in_their_order) {
    node->on_bind("count");
    bind();
    std::thread{[to = updates] {
        for (int i = 1; i <= 10; ++i) {
            to.update("count", i);
        }
    }}.join();
    BOOST_TEST(got.empty());
    run_until(io, [&] { return got.size() == 10; });
    for (int i = 0; i < 10; ++i) {
        BOOST_TEST(got[static_cast<std::size_t>(i)] == i + 1);
    }
}

BOOST_AUTO_TEST_CASE(past_the_limit_the_oldest_are_removed_and_that_is_reported) {
    node->on_bind("count");
    bind(65536);
    constexpr int too_many = 5000;
    for (int i = 1; i <= too_many; ++i) {
        updates.update("count", i);
    }
    run_until(io, [&] { return !got.empty() && got.back() == too_many; });
    BOOST_TEST(got.size() == 1024U);
    BOOST_TEST(got.front() == too_many - 1023);
    BOOST_TEST(was_said("3976 updates were dropped"));
    updates.update("count", 1);
    run_until(io, [&] { return got.size() == 1025U; });
}

BOOST_AUTO_TEST_CASE(large_ones_are_limited_by_their_bytes_but_the_newest_gets_through) {
    node->on_bind("count");
    const std::string large(1000 * 1000, 'x');
    for (int i = 0; i < 10; ++i) {
        updates.update("text", large);
    }
    run_ready(io);
    BOOST_TEST(was_said("6 updates were dropped"));
    BOOST_TEST(node->request("PULL self:cles/metrics").find(R"("updates_published":4,)") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(what_the_service_refuses_is_logged) {
    updates.update("not a noun", 1);
    updates.update("cles", 1);
    run_ready(io);
    BOOST_TEST(was_said("an update of 'not a noun' was refused"));
    BOOST_TEST(was_said("an update of 'cles' was refused: the task 'cles' is reserved"));
}

BOOST_AUTO_TEST_CASE(after_the_service_is_destroyed_they_have_no_effect) {
    updates.update("count", 1);
    node.reset();
    updates.update("count", 2);
    run_ready(io);
    BOOST_TEST(said.empty());
}

BOOST_AUTO_TEST_CASE(many_threads_may_publish_at_once) {
    node->on_bind("count");
    bind(65536);
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
        threads.emplace_back([to = updates] {
            for (int i = 0; i < 200; ++i) {
                to.update("count", i);
            }
        });
    }
    run_until(io, [&] { return got.size() == 800; });
    for (auto& thread : threads) {
        thread.join();
    }
}

BOOST_AUTO_TEST_CASE(a_value_is_written_once_whatever_the_number_of_subscribers) {
    cles::service car{io, {.name = "car", .listen = {"tcp://127.0.0.1:0"}}};
    car.on_bind("count");
    std::vector<std::unique_ptr<cles::service>> towers;
    std::vector<int_feed> feeds;
    constexpr std::size_t subscribers = 8;
    std::size_t arrived = 0;
    for (std::size_t i = 0; i < subscribers; ++i) {
        towers.push_back(
            std::make_unique<cles::service>(io, cles::service_options{.name = "tower" + std::to_string(i),
                                                                      .peers = {{"car", car.endpoints().front()}}}));
        towers.back()->async_bind<int>("car:count", [&](boost::system::error_code, int_feed made) {
            made.async_next([&](boost::system::error_code, const auto& event) { arrived += event.value == 1 ? 1 : 0; });
            feeds.push_back(std::move(made));
        });
    }
    run_until(io, [&] { return feeds.size() == subscribers; });
    int writes = 0;
    car.update("count", counted{&writes});
    run_until(io, [&] { return arrived == subscribers; });
    BOOST_TEST(writes == 1);
}

BOOST_AUTO_TEST_SUITE_END()
