// SPDX-License-Identifier: BSL-1.0
// Every option of the public structs at its minimum, at its maximum and beyond both: it works, or it is refused with an
// error that names it.

#include <cles/convert_containers.hpp>
#include <cles/limit_ranges.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/feed_log.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(options)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;
using std::chrono::milliseconds;

constexpr auto forever = milliseconds::max();
constexpr auto never = milliseconds::min();

// The error about limits when a service is made; empty if it is made.
std::string refusal_of(const cles::limits& bounds) {
    boost::asio::io_context io;
    try {
        const cles::service node{io, {.name = "car1", .limits = bounds}};
    } catch (const cles::error& e) {
        BOOST_TEST((e.code() == errc::invalid_option), e.what());
        return e.message();
    }
    return {};
}

BOOST_AUTO_TEST_CASE(peers_can_be_used_as_a_standard_map) {
    using map = std::map<std::string, std::string>;
    const map others{{"car2", "tcp://127.0.0.1:1"}};
    cles::service_options options{.name = "car1", .peers = others};
    options.peers["car3"] = "tcp://127.0.0.1:2";
    const auto copy = options;
    const auto moved = std::move(options);
    BOOST_TEST((copy.peers == moved.peers));
    BOOST_TEST(moved.peers.at("car3") == "tcp://127.0.0.1:2");

    options.peers = {};
    BOOST_TEST(options.peers.empty());
    options.peers = {{"car4", "tcp://127.0.0.1:4"}};
    BOOST_TEST(options.peers.size() == 1U);
    options.peers = others;
    options.peers = map{others};
    options.peers = {others.begin(), others.end()};
    map plain = options.peers;
    plain.clear();
    options.peers.swap(plain);
    BOOST_TEST((options.peers.empty() && plain == others));
    plain = std::move(options.peers);

    const cles::service_options read{.name = "car1", .peers = cles::from_json<cles::peer_urls>(cles::to_json(others))};
    BOOST_TEST((read.peers == others));
    BOOST_TEST(cles::to_json(read.peers) == cles::to_json(others));
}

BOOST_AUTO_TEST_CASE(a_limit_is_taken_within_its_range_and_refused_by_name_beyond_it) {
    constexpr auto most = std::numeric_limits<std::size_t>::max();
    for (const auto& range : cles::count_ranges) {
        for (const auto value : {std::size_t{0}, std::size_t{1}, range.least - 1, range.least, range.most,
                                 range.most + 1, most / 2, most}) {
            cles::limits bounds;
            bounds.*range.member = value;
            const auto why = refusal_of(bounds);
            const bool fits = value >= range.least && value <= range.most;
            BOOST_TEST(why.empty() == fits, range.name << " at " << value << ": " << why);
            BOOST_TEST((fits || why.find("limits." + std::string{range.name} + " ") != std::string::npos), why);
        }
    }
    for (const auto& range : cles::time_ranges) {
        for (const auto value : {never, -1ms, 0ms, 1ms, range.least - 1ms, range.least, range.most, range.most + 1ms,
                                 milliseconds{INT32_MAX}, forever}) {
            cles::limits bounds;
            bounds.*range.member = value;
            const auto why = refusal_of(bounds);
            const bool fits = value >= range.least && value <= range.most;
            BOOST_TEST(why.empty() == fits, range.name << " at " << value.count() << " ms: " << why);
            BOOST_TEST((fits || why.find("limits." + std::string{range.name} + " ") != std::string::npos), why);
        }
    }
}

BOOST_AUTO_TEST_CASE(every_member_of_limits_has_a_range_and_lies_within_it) {
    static_assert(sizeof(cles::limits) ==
                  cles::count_ranges.size() * sizeof(std::size_t) + cles::time_ranges.size() * sizeof(milliseconds));
    BOOST_TEST(refusal_of({}).empty());
}

enum class extreme : std::uint8_t { least, most };

std::ostream& operator<<(std::ostream& out, extreme e) { return out << (e == extreme::least ? "least" : "most"); }

cles::limits all_at(extreme e) {
    cles::limits bounds;
    for (const auto& range : cles::count_ranges) {
        bounds.*range.member = e == extreme::least ? range.least : range.most;
    }
    for (const auto& range : cles::time_ranges) {
        bounds.*range.member = e == extreme::least ? range.least : range.most;
    }
    bounds.connect = std::max(bounds.connect, 5000ms); // whether it succeeds within a millisecond is not deterministic
    bounds.stall = std::max(bounds.stall, 5000ms);
    return bounds;
}

// Many turns, so that what is renewed, timed and queued reaches its limits too.
BOOST_DATA_TEST_CASE(with_all_limits_at_an_end_of_their_ranges_nodes_talk,
                     boost::unit_test::data::make({extreme::least, extreme::most}) *
                         boost::unit_test::data::make({carrier::tcp4, carrier::udp4, carrier::inproc}),
                     at, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind, all_at(at))};
    cles::service tower{io, knowing("tower", car, all_at(at))};
    car.on_pull("speed", [] { return 7; });
    car.on_bind("place");
    feed_log feed;
    feed.bind(tower, "car1:place");
    run_until(io, [&] { return feed.binds == 1; });
    BOOST_TEST(feed.bound, feed.words);
    for (int i = 1; i <= 20; ++i) {
        answer<int> pulled;
        tower.async_pull<int>("car1:speed", pulled.options(), pulled.take());
        run_until(io, [&] { return pulled.done(); });
        BOOST_TEST(!pulled.code, pulled.words);
        BOOST_TEST(pulled.value == 7);
        car.update("place", i);
        run_until(io, [&] { return feed.items.size() == static_cast<std::size_t>(i); });
    }
    BOOST_TEST(feed.count(cles::feed_event::update) == feed.items.size());
}

// -- of one operation ------------------------------------------------------------------------------------------------

struct nodes {
    nodes() {
        car.on_pull("speed", [] { return 7; });
        car.on_push("notice", [] {});
        car.on_delegate("drive", [] {});
        car.on_bind("place");
    }
    boost::asio::io_context io;
    cles::service car{io, listening("car1")};
    cles::service tower{io, knowing("tower", car)};
};

BOOST_FIXTURE_TEST_CASE(a_deadline_may_be_anything_from_nothing_on, nodes) {
    using start = std::function<void(const cles::call_options&, answer<>&)>;
    const std::array<start, 4> operations{
        [&](const cles::call_options& o, answer<>& a) { tower.async_pull("car1:speed", o, a.take()); },
        [&](const cles::call_options& o, answer<>& a) { tower.async_push("car1:notice", 1, o, a.take()); },
        [&](const cles::call_options& o, answer<>& a) { tower.async_delegate("car1:drive", 1, o, a.take()); },
        [&](const cles::call_options& o, answer<>& a) { tower.async_request("PULL car1:speed", o, a.take()); },
    };
    for (const auto& start_with : operations) {
        for (const auto limit : {never, -1ms, 0ms, 1ms, milliseconds{24h}, milliseconds{25h}, forever}) {
            answer<> got;
            start_with(got.options().deadline(limit), got);
            run_until(io, [&] { return got.done(); });
            if (limit < 0ms) {
                BOOST_TEST((got.code == errc::invalid_option), got.code.message());
                BOOST_TEST(got.words.starts_with("call_options::deadline is "), got.words);
            } else if (limit == 1ms) { // it may be too short
                BOOST_TEST((!got.code || got.code == errc::deadline), got.words);
            } else {
                BOOST_TEST(!got.code, limit.count() << " ms: " << got.words);
            }
        }
    }
}

BOOST_FIXTURE_TEST_CASE(the_hops_of_a_request_are_checked, nodes) {
    for (const auto hops : {0U, 8U, 16U, 17U}) {
        answer<> got;
        tower.async_pull("car1:speed", got.options().hops(hops), got.take());
        run_until(io, [&] { return got.done(); });
        if (hops > 16) {
            BOOST_TEST((got.code == errc::invalid_option), got.code.message());
            BOOST_TEST(got.words == "call_options::hops is 17: must be 0 to 16");
        } else {
            BOOST_TEST(!got.code, got.words);
        }
    }
    answer<> in_text, unknown;
    tower.async_request("PULL car1:speed hops=15", in_text.options(), in_text.take());
    tower.async_request("PULL car1:speed via=car7", unknown.options(), unknown.take());
    run_until(io, [&] { return in_text.done() && unknown.done(); });
    BOOST_TEST(!in_text.code, in_text.words);
    BOOST_TEST((unknown.code == errc::bad_request), unknown.words);
}

struct bind_case {
    cles::bind_options options;
    std::string_view refused{}; ///< the option; empty: it is accepted
};

BOOST_FIXTURE_TEST_CASE(a_bindings_options_work_or_are_refused_by_name, nodes) {
    constexpr auto most_32 = std::numeric_limits<std::uint32_t>::max();
    using made = cles::bind_options;
    const std::vector<bind_case> cases{
        {made{}.deadline(never), "deadline"},
        {made{}.deadline(-1ms), "deadline"},
        {made{}.deadline(0ms)},
        {made{}.deadline(forever)},
        {made{}.deadline(forever - 1ms)},
        {made{}.every(never), "every"},
        {made{}.every(-1ms), "every"},
        {made{}.every(0ms)},
        {made{}.every(1ms)},
        {made{}.every(24h)},
        {made{}.every(forever)},
        {made{}.keep(0)},
        {made{}.keep(1)},
        {made{}.keep(65'536)},
        {made{}.keep(65'537), "keep"},
        {made{}.keep(most_32), "keep"},
        {made{}.hops(0)},
        {made{}.hops(16)},
        {made{}.hops(17), "hops"},
    };
    for (const auto& each : cases) {
        feed_log feed;
        feed.bind(tower, "car1:place", each.options);
        run_until(io, [&] { return feed.binds == 1; });
        if (each.refused.empty()) {
            BOOST_TEST(feed.bound, feed.words);
            const auto before = feed.items.size();
            car.update("place", 1);
            run_until(io, [&] { return feed.items.size() > before; });
        } else {
            BOOST_TEST((feed.code == errc::invalid_option), feed.code.message());
            BOOST_TEST(feed.words.starts_with("bind_options::" + std::string{each.refused} + " is "), feed.words);
        }
    }
}

// -- of programs -----------------------------------------------------------------------------------------------------

std::string refusal_of(const cles::run_options& how) {
    boost::asio::io_context io;
    int ran = 0;
    boost::asio::post(io, [&] { ++ran; });
    try {
        cles::run(io, how);
    } catch (const cles::error& e) {
        BOOST_TEST((e.code() == errc::invalid_option), e.what());
        BOOST_TEST(ran == 0);
        return e.message();
    } catch (const std::system_error& e) {
        return e.what(); // from the system, which may not allow the priority
    }
    BOOST_TEST(ran == 1);
    return {};
}

BOOST_AUTO_TEST_CASE(run_takes_any_time_from_nothing_and_the_priorities_there_are) {
    using std::chrono::microseconds;
    for (const auto poll : {microseconds{0}, microseconds{1}, microseconds::max()}) {
        BOOST_TEST(refusal_of(cles::run_options{.busy_poll = poll}).empty());
    }
    for (const auto poll : {microseconds{-1}, microseconds::min()}) {
        BOOST_TEST(refusal_of(cles::run_options{.busy_poll = poll}).starts_with("run_options::busy_poll is "));
    }
    for (const int priority : {-1, 100, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()}) {
        BOOST_TEST(
            refusal_of(cles::run_options{.fifo_priority = priority}).starts_with("run_options::fifo_priority is "));
    }
    for (const int priority : {1, 99}) { // the system's error counts, not ours
        BOOST_TEST(!refusal_of(cles::run_options{.fifo_priority = priority}).starts_with("run_options"));
    }
}

BOOST_AUTO_TEST_CASE(seeds_need_the_part_that_asks_them) {
    boost::asio::io_context io;
    const auto names_gossip = [](const cles::error& e) {
        return e.code() == errc::invalid_option && e.message().starts_with("gossip_options ");
    };
    const cles::gossip_options without{.seeds = {"tcp://127.0.0.1:1"}};
    BOOST_CHECK_EXCEPTION((cles::service{io, {.name = "car1", .gossip = without}}), cles::error, names_gossip);
    cles::service car{io, {.name = "car1"}};
    BOOST_CHECK_EXCEPTION(car.set_gossip(without), cles::error, names_gossip);
    car.set_gossip({});
    car.set_gossip(cles::gossip());
}

BOOST_AUTO_TEST_CASE(a_multicast_port_may_be_any_but_0) {
    cles::multicast_options where{.interface = "lo"};
    for (const auto port : {std::uint16_t{1}, std::uint16_t{65'535}}) {
        where.port = port;
        BOOST_CHECK_NO_THROW(cles::check(where));
    }
    where.port = 0;
    BOOST_CHECK_EXCEPTION(cles::check(where), cles::error,
                          [](const cles::error& e) { return e.code() == errc::invalid_url; });
}

BOOST_AUTO_TEST_SUITE_END()
