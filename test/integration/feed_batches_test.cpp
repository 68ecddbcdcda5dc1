// SPDX-License-Identifier: BSL-1.0
// Feeds that are read in batches: what a batch has, that nothing is missing, and what user code may do there.

#include <cles/feed_batch.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/user_code_fixture.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace feed_batches_test {

using namespace cles::test;
namespace asio = boost::asio;
using cles::errc;
using cles::feed_event;

constexpr std::array carriers{carrier::tcp4, carrier::unix_file, carrier::inproc};
constexpr std::uint32_t all_kept = 10'000; // at the publisher, for each binding

/// A feed that is read in batches, all the time.
struct reader {
    void bind(cles::service& from) {
        from.async_bind<int>("car1:place", cles::bind_options{}.keep(all_kept),
                             [this](boost::system::error_code failed, cles::feed<int> made) {
                                 BOOST_TEST(!failed);
                                 feed = std::move(made);
                                 fetch();
                             });
    }
    void fetch() {
        feed.async_next_batch([this](boost::system::error_code failed, std::span<const cles::feed_item<int>> events) {
            code = failed;
            if (failed && failed != errc::conversion) {
                return;
            }
            BOOST_TEST((failed || !events.empty()));
            ++batches;
            for (const auto& event : events) {
                BOOST_TEST(event.missed == 0U);
                if (event.kind == feed_event::update) {
                    values.push_back(event.value);
                }
            }
            if (failed) {
                values.push_back(-1);
            }
            fetch();
        });
    }

    cles::feed<int> feed;
    std::vector<int> values; // -1: one that does not convert
    std::size_t batches = 0;
    boost::system::error_code code;
};

std::vector<int> one_to(int last) {
    std::vector<int> all(static_cast<std::size_t>(last));
    std::iota(all.begin(), all.end(), 1);
    return all;
}

/// A publisher, and a service whose feeds hold so many updates.
struct fixture {
    explicit fixture(carrier kind = carrier::tcp4, std::size_t held = 1024)
        : car(io, listening("car1", kind)), tower(io, knowing("tower", car, holding(held))) {
        car.on_bind("place");
    }
    static cles::limits holding(std::size_t updates) {
        cles::limits bounds;
        bounds.feed = updates;
        return bounds;
    }
    void until_open(const reader& r) {
        run_until(io, [&] { return r.feed.is_open(); });
    }
    void publish(int first, int last) {
        for (auto i = first; i <= last; ++i) {
            car.update("place", i);
        }
    }

    asio::io_context io;
    cles::service car;
    cles::service tower;
};

asio::awaitable<std::size_t> sum_of(cles::service& tower, std::size_t count) {
    auto feed = co_await tower.async_bind<int>("car1:place", cles::bind_options{}.keep(all_kept));
    std::size_t sum = 0;
    while (count != 0) {
        for (const auto& event : co_await feed.async_next_batch()) {
            sum += static_cast<std::size_t>(event.value);
            --count;
        }
    }
    co_return sum;
}

} // namespace feed_batches_test

BOOST_AUTO_TEST_SUITE(feed_batches)

using namespace feed_batches_test;
using namespace cles::test::user_code_fixture;
namespace data = boost::unit_test::data;

static_assert(std::is_nothrow_move_constructible_v<cles::feed_batch<std::string>>);
static_assert(std::is_convertible_v<cles::feed_batch<int>, std::span<const cles::feed_item<int>>>);

CLES_DATA_TEST_CASE(updates_that_come_together_are_in_few_batches_in_order, carriers, kind) {
    fixture f{kind};
    reader r;
    r.bind(f.tower);
    f.until_open(r);
    f.publish(1, 3000);
    run_until(f.io, [&] { return r.values.size() == 3000; });
    BOOST_TEST((r.values == one_to(3000)));
    BOOST_TEST(r.batches < 300U);
}

CLES_DATA_TEST_CASE(none_is_missing_although_the_feed_holds_fewer_than_one_read_brings, carriers, kind) {
    fixture f{kind, 4};
    reader one;
    one.bind(f.tower);
    f.until_open(one);
    f.publish(1, 500);
    run_until(f.io, [&] { return one.values.size() == 500; });
    BOOST_TEST((one.values == one_to(500)));

    reader other; // shares the binding
    other.bind(f.tower);
    f.until_open(other);
    one.values.clear();
    f.publish(1, 500);
    run_until(f.io, [&] { return one.values.size() == 500 && other.values.size() == 500; });
    BOOST_TEST((one.values == one_to(500)));
    BOOST_TEST((other.values == one_to(500)));
}

BOOST_FIXTURE_TEST_CASE(a_coroutine_goes_through_them, fixture) {
    std::optional<std::size_t> sum;
    asio::co_spawn(io, sum_of(tower, 100), [&](const std::exception_ptr& failed, std::size_t all) {
        BOOST_TEST(!failed);
        sum = all;
    });
    run_ready(io);
    publish(1, 100);
    run_until(io, [&] { return sum.has_value(); });
    BOOST_TEST(*sum == 5050U);
}

BOOST_FIXTURE_TEST_CASE(one_that_does_not_convert_is_told_in_its_place, fixture) {
    reader r;
    r.bind(tower);
    until_open(r);
    publish(1, 2);
    car.update("place", "far");
    car.update("place", "away");
    publish(3, 4);
    run_until(io, [&] { return r.values.size() == 6; });
    BOOST_TEST((r.values == std::vector{1, 2, -1, -1, 3, 4}));
}

BOOST_FIXTURE_TEST_CASE(single_waits_and_batches_take_turns, fixture) {
    std::optional<cles::feed<int>> feed;
    tower.async_bind<int>("car1:place",
                          [&](boost::system::error_code, cles::feed<int> made) { feed = std::move(made); });
    run_until(io, [&] { return feed.has_value(); });
    publish(1, 5);
    run_ready(io);
    cles::feed_item<int> first;
    cles::feed_batch<int> rest;
    feed->async_next([&](boost::system::error_code, const cles::feed_item<int>& item) { first = item; });
    run_until(io, [&] { return first.value == 1; });
    feed->async_next_batch([&](boost::system::error_code, cles::feed_batch<int> batch) { rest = std::move(batch); });
    run_until(io, [&] { return !rest.empty(); });
    BOOST_TEST(rest.size() == 4U);
    BOOST_TEST(rest[3].value == 5);
    BOOST_TEST(rest[3].seq == 5U);

    int busy = 0;
    feed->async_next_batch([](boost::system::error_code, const cles::feed_batch<int>&) {});
    feed->async_next_batch([&](boost::system::error_code code, const cles::feed_batch<int>& batch) {
        BOOST_TEST(code == errc::busy);
        BOOST_TEST(batch.empty());
        ++busy;
    });
    run_until(io, [&] { return busy == 1; });
}

BOOST_FIXTURE_TEST_CASE(a_batch_outlives_its_feed_and_the_next_batches, fixture) {
    cles::feed<int> feed;
    std::vector<cles::feed_batch<int>> kept;
    tower.async_bind<int>("car1:place",
                          [&](boost::system::error_code, cles::feed<int> made) { feed = std::move(made); });
    run_until(io, [&] { return feed.is_open(); });
    for (int i = 1; i <= 4; ++i) {
        feed.async_next_batch(
            [&](boost::system::error_code, cles::feed_batch<int> batch) { kept.push_back(std::move(batch)); });
        publish(i, i);
        run_until(io, [&] { return kept.size() == static_cast<std::size_t>(i); });
    }
    feed = {};
    for (int i = 1; i <= 4; ++i) {
        BOOST_TEST(kept[static_cast<std::size_t>(i - 1)][0].value == i);
    }
}

BOOST_FIXTURE_TEST_CASE(a_feed_that_is_not_open_fails, fixture) {
    reader r;
    r.bind(tower);
    until_open(r);
    r.feed.close();
    run_until(io, [&] { return r.code == errc::cancelled; });
    boost::system::error_code code;
    r.feed.async_next_batch([&](boost::system::error_code failed, const cles::feed_batch<int>&) { code = failed; });
    run_until(io, [&] { return code == errc::closed; });
}

// Those of one noun share a binding.
BOOST_DATA_TEST_CASE(who_waits_for_a_batch_may_do_anything, data::make(every_deed) * data::make({false, true}), does,
                     share) {
    for (const auto where : {place::reply, place::queued, place::lost, place::cancelled, place::stop}) {
        BOOST_TEST_CONTEXT("at " << where) {
            world w;
            std::vector<std::unique_ptr<cles::feed<cles::json_text>>> feeds;
            for (const std::string noun : {"car2:place", "car2:place1", "car2:place2"}) {
                w.tower->async_bind(share ? "car2:place" : noun,
                                    [&](boost::system::error_code, cles::feed<cles::json_text> made) {
                                        feeds.push_back(std::make_unique<cles::feed<cles::json_text>>(std::move(made)));
                                    });
            }
            w.until([&] { return feeds.size() == 3; });
            const auto update_all = [&] {
                for (const auto* noun : {"place", "place1", "place2"}) {
                    w.car->update(noun, 1);
                }
            };
            if (where == place::queued) {
                update_all();
                update_all();
                w.run_what_is_ready();
            }
            std::array<int, 3> calls{};
            const std::array<asio::cancellation_signal*, 3> signals{&w.first, &w.second, &w.third};
            for (std::size_t i = 0; i < 3; ++i) {
                feeds[i]->async_next_batch(asio::bind_cancellation_slot(
                    signals[i]->slot(), handler{&w, &calls[i], i == 1 ? does : deed::nothing}));
            }
            if (where == place::reply) {
                update_all();
            } else if (where == place::lost) {
                w.car.reset();
            } else if (where == place::cancelled) {
                for (auto* each : {&w.second, &w.first, &w.third}) {
                    each->emit(asio::cancellation_type::terminal);
                }
            } else if (where == place::stop) {
                w.tower->stop();
            }
            BOOST_TEST(calls[1] == 0);
            check_that_three_are_called(w, does, calls);
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
