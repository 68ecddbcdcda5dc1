// SPDX-License-Identifier: BSL-1.0
// Bindings by multicast, over loopback; test/cli/multicast_test.py tests them between hosts.

#include <cles/convert.hpp>
#include <cles/service.hpp>

#include "support/feed_log.hpp"
#include "support/group_address.hpp"
#include "support/metric.hpp"
#include "support/run_until.hpp"
#include "transport/group_port.hpp"
#include "transport/ip_interface.hpp"

#include <boost/describe/class.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace multicast_types {

struct place {
    int x = 0;
};
BOOST_DESCRIBE_STRUCT(place, (), (x))

/// Movable, not copyable.
struct leg {
    leg() = default;
    leg(leg&&) = default;
    leg& operator=(leg&&) = default;
    int length = 0;
};
BOOST_DESCRIBE_STRUCT(leg, (), (length))

struct route {
    std::vector<leg> legs{};
};
BOOST_DESCRIBE_STRUCT(route, (), (legs))

/// Counts how often one is read.
struct counted : place {
    static inline int reads = 0;
};

} // namespace multicast_types

template <>
struct cles::converter<multicast_types::counted> {
    static void write(json_writer& w, const multicast_types::counted& value) {
        write_json(w, static_cast<const multicast_types::place&>(value));
    }
    static bool read(json_reader& r, multicast_types::counted& value) {
        ++multicast_types::counted::reads;
        return read_json(r, static_cast<multicast_types::place&>(value));
    }
};

BOOST_AUTO_TEST_SUITE(multicast)

using namespace cles::test;
using multicast_types::counted;
using multicast_types::route;
using namespace std::chrono_literals;
using cles::errc;
using cles::feed_event;

namespace {

/// A member of the group that is not a node: receives everything, and sends what a test specifies.
struct plain_member final : cles::core::group_listener {
    plain_member(boost::asio::io_context& io, const cles::multicast_options& where)
        : port(std::make_shared<cles::transport::group_port>(io.get_executor(),
                                                             cles::transport::find_interface(where.interface), where)) {
        port->start(*this);
    }
    ~plain_member() { port->close(); }
    void on_datagram(const cles::core::group_datagram& datagram) override { heard.emplace_back(datagram.text); }
    void on_writable() override {}
    void say(std::string_view line) { port->send(line); }
    [[nodiscard]] std::size_t count(std::string_view head) const {
        return static_cast<std::size_t>(
            std::count_if(heard.begin(), heard.end(), [&](const auto& d) { return d.starts_with(head); }));
    }

    std::shared_ptr<cles::transport::group_port> port;
    std::vector<std::string> heard;
};

struct network {
    std::unique_ptr<cles::service> node(std::string name, const cles::limits& bounds = {}) {
        cles::service_options options{.name = std::move(name)};
        options.multicast = where;
        options.limits = bounds;
        options.log = [this](cles::log_level level, std::string_view text) {
            if (level != cles::log_level::debug) {
                log.emplace_back(text);
            }
        };
        return std::make_unique<cles::service>(io, std::move(options));
    }
    void until_bound(feed_log& feed, cles::service& binder, std::string_view noun,
                     const cles::bind_options& options = {}) {
        feed.bind(binder, noun, options);
        run_until(io, [&] { return feed.binds != 0; });
        BOOST_REQUIRE_MESSAGE(feed.bound, feed.code.message() << ": " << feed.words);
    }
    [[nodiscard]] bool logged(std::string_view text) const {
        return std::any_of(log.begin(), log.end(),
                           [&](const auto& line) { return line.find(text) != std::string::npos; });
    }

    boost::asio::io_context io;
    cles::multicast_options where = fresh_group();
    std::vector<std::string> log;
};

/// Publisher and seq of each update: "car1 1".
std::vector<std::string> updates(const feed_log& feed) {
    std::vector<std::string> all;
    for (const auto& i : feed.items) {
        if (i.kind == feed_event::update) {
            all.push_back(i.publisher + " " + std::to_string(i.seq));
        }
    }
    return all;
}

const cles::bind_options by_group = cles::bind_options{}.multicast();

} // namespace

BOOST_FIXTURE_TEST_CASE(a_feed_of_all_receives_every_publisher, network) {
    const auto car1 = node("car1");
    const auto car2 = node("car2");
    const auto tower = node("tower");
    car1->update("place", 1);
    feed_log feed;
    until_bound(feed, *tower, "all:place");
    run_until(io, [&] { return feed.items.size() == 1; }); // the last value, soon
    car1->update("place", 2);
    car2->update("place", 3); // its first
    run_until(io, [&] { return feed.items.size() == 3; });
    auto heard = updates(feed);
    std::sort(heard.begin(), heard.end());
    BOOST_TEST((heard == std::vector<std::string>{"car1 1", "car1 2", "car2 1"}));
    BOOST_TEST(logged("car1 has joined 239.255.25.37:" + std::to_string(where.port) + " on lo"));
}

BOOST_FIXTURE_TEST_CASE(one_datagram_serves_eight_binders, network) {
    plain_member sniffer{io, where};
    const auto car = node("car1");
    std::vector<std::unique_ptr<cles::service>> towers;
    std::vector<std::unique_ptr<feed_log>> feeds;
    for (int i = 0; i < 8; ++i) {
        towers.push_back(node("tower" + std::to_string(i)));
        feeds.push_back(std::make_unique<feed_log>());
        until_bound(*feeds.back(), *towers.back(), i % 2 == 0 ? "all:place" : "car1:place", by_group);
    }
    run_until(io, [&] {
        return sniffer.count("BIND all:place") == 4 && sniffer.count("BIND car1:place") == 4 &&
               metric(*car, "group_leases") == 8;
    });
    for (int i = 0; i < 5; ++i) {
        car->update("place", i);
        run_until(io, [&] {
            return std::all_of(feeds.begin(), feeds.end(), [&](const auto& f) { return f->items.size() == i + 1U; });
        });
    }
    BOOST_TEST(sniffer.count("UPDATE") == 5U);
    BOOST_TEST(metric(*car, "group_sent") == 6U); // and BIND all:cles at its start
    BOOST_TEST(metric(*towers[0], "updates_received") == 5U);
}

BOOST_FIXTURE_TEST_CASE(a_type_reads_a_datagram_once_for_all_its_feeds, network) {
    const auto car = node("car1");
    std::vector<std::unique_ptr<cles::service>> towers;
    std::vector<cles::feed<counted>> feeds;
    std::vector<int> heard;
    int refused = 0;
    for (int i = 0; i < 3; ++i) {
        towers.push_back(node("tower" + std::to_string(i)));
        towers.back()->async_bind<counted>(
            "car1:place", by_group,
            [&](boost::system::error_code, cles::feed<counted> f) { feeds.push_back(std::move(f)); });
    }
    const auto plain = node("plain");
    feed_log text;
    until_bound(text, *plain, "car1:place", by_group);
    run_until(io, [&] { return feeds.size() == 3 && metric(*car, "group_leases") == 4; });
    const auto publish = [&](const auto& value, std::size_t so_far) {
        for (auto& f : feeds) {
            f.async_next([&](boost::system::error_code failed, const cles::feed_item<counted>& item) {
                refused += failed == errc::conversion ? 1 : 0;
                heard.push_back(item.value.x);
            });
        }
        run_ready(io);
        counted::reads = 0;
        car->update("place", value);
        run_until(io, [&] { return heard.size() == 3 && text.items.size() == so_far; });
    };
    publish(counted{{7}}, 1);
    BOOST_TEST(heard == (std::vector<int>{7, 7, 7}), boost::test_tools::per_element());
    BOOST_TEST(counted::reads == 1);
    heard.clear();
    publish(counted{{8}}, 2); // the previously read value is forgotten
    BOOST_TEST(heard == (std::vector<int>{8, 8, 8}), boost::test_tools::per_element());
    BOOST_TEST(text.items[1].value.text == R"({"x":8})");
    heard.clear();
    publish(std::string{"eight"}, 3); // and each refuses what cannot be read
    BOOST_TEST(refused == 3);
}

// What copies might share, or what cannot be copied, is read by each feed separately.
BOOST_FIXTURE_TEST_CASE(other_types_are_read_by_each_feed, network) {
    const auto car = node("car1");
    const auto tower1 = node("tower1");
    const auto tower2 = node("tower2");
    std::vector<cles::feed<route>> feeds;
    for (auto* tower : {tower1.get(), tower2.get()}) {
        tower->async_bind<route>("car1:route", by_group, [&](boost::system::error_code, cles::feed<route> f) {
            feeds.push_back(std::move(f));
        });
    }
    run_until(io, [&] { return feeds.size() == 2 && metric(*car, "group_leases") == 2; });
    std::size_t legs = 0;
    for (auto& f : feeds) {
        f.async_next(
            [&](boost::system::error_code, const cles::feed_item<route>& item) { legs += item.value.legs.size(); });
    }
    route three;
    three.legs.resize(3);
    car->update("route", three);
    run_until(io, [&] { return legs == 6; });
}

BOOST_FIXTURE_TEST_CASE(the_last_value_of_one_node_arrives_at_once, network) {
    const auto car = node("car1");
    const auto tower = node("tower");
    car->update("place", 7);
    car->update("place", 8);
    feed_log feed;
    until_bound(feed, *tower, "car1:place", by_group);
    run_until(io, [&] { return !feed.items.empty(); });
    BOOST_TEST(updates(feed).front() == "car1 2");
    BOOST_TEST(feed.items[0].value.text == R"({"value":8})");
}

BOOST_FIXTURE_TEST_CASE(a_feed_that_was_there_first_gets_the_first_update, network) {
    const auto tower = node("tower");
    feed_log feed;
    const auto car = node("car1");
    until_bound(feed, *tower, "all:place");
    run_until(io, [&] { return metric(*car, "group_leases") == 1; });
    car->update("place", 1);
    run_until(io, [&] { return !feed.items.empty(); });
    BOOST_TEST(updates(feed).front() == "car1 1");
}

BOOST_FIXTURE_TEST_CASE(a_node_neither_receives_itself_nor_binds_itself, network) {
    const auto car = node("car1");
    feed_log feed;
    until_bound(feed, *car, "all:place");
    plain_member sniffer{io, where};
    car->update("place", 1);
    run_ready(io);
    BOOST_TEST(feed.items.empty());
    BOOST_TEST(sniffer.heard.empty());
    BOOST_TEST(metric(*car, "group_received") == 0U);
    feed_log own;
    own.bind(*car, "car1:place", by_group);
    run_until(io, [&] { return own.binds != 0; });
    BOOST_TEST((own.code == errc::no_target));
}

BOOST_FIXTURE_TEST_CASE(a_lease_expires_when_its_subscriber_fails_silently, network) {
    const auto car = node("car1");
    plain_member binder{io, where};
    binder.say("BIND all:place lease=100\n");
    run_until(io, [&] { return metric(*car, "group_leases") == 1; });
    run_until(io, [&] { return metric(*car, "leases_expired") == 1; });
    BOOST_TEST(metric(*car, "group_leases") == 0U);
    car->update("place", 1);
    run_ready(io);
    BOOST_TEST(binder.count("UPDATE") == 0U);
}

BOOST_FIXTURE_TEST_CASE(renewals_keep_a_binding_beyond_its_lease, network) {
    cles::limits bounds;
    bounds.lease = 3000ms;
    const auto car = node("car1");
    const auto tower = node("tower", bounds);
    plain_member sniffer{io, where};
    feed_log feed;
    until_bound(feed, *tower, "all:place");
    run_until(io, [&] { return sniffer.count("BIND all:place lease=3000") >= 5; });
    BOOST_TEST(metric(*car, "leases_expired") == 0U);
    car->update("place", 1);
    run_until(io, [&] { return !feed.items.empty(); });
}

BOOST_FIXTURE_TEST_CASE(closing_the_last_feed_and_stopping_withdraw_the_binding, network) {
    const auto car = node("car1");
    const auto tower = node("tower");
    plain_member sniffer{io, where};
    feed_log one;
    feed_log two;
    until_bound(one, *tower, "all:place");
    until_bound(two, *tower, "all:place");
    run_until(io, [&] { return metric(*car, "group_leases") == 1; });
    one.close();
    run_ready(io);
    BOOST_TEST(sniffer.count("BIND all:place lease=0") == 0U);
    two.close();
    run_until(io, [&] { return metric(*car, "group_leases") == 0; });
    run_ready(io); // each receives it separately
    BOOST_TEST(sniffer.count("BIND all:place lease=0") == 1U);
    feed_log three;
    until_bound(three, *tower, "all:speed");
    tower->stop();
    run_until(io, [&] { return sniffer.count("BIND all:speed lease=0") == 1 && three.is_over(); });
    BOOST_TEST((three.code == errc::stopped));
}

BOOST_FIXTURE_TEST_CASE(gaps_and_repetitions_are_reported_for_each_publisher, network) {
    const auto tower = node("tower");
    plain_member publisher{io, where};
    feed_log feed;
    until_bound(feed, *tower, "all:place");
    for (const auto* line : {"UPDATE a:place seq=1 epoch=00000001 {}\n", "UPDATE b:place seq=7 epoch=00000002 {}\n",
                             "UPDATE a:place seq=4 epoch=00000001 {}\n", "UPDATE a:place seq=2 epoch=00000001 {}\n",
                             "UPDATE b:place seq=8 epoch=00000002 {}\n"}) {
        publisher.say(line);
    }
    run_until(io, [&] { return feed.items.size() == 5; });
    BOOST_TEST((updates(feed) == std::vector<std::string>{"a 1", "b 7", "a 4", "b 8"}));
    BOOST_REQUIRE((feed.items[2].kind == feed_event::gap));
    BOOST_TEST(feed.items[2].publisher == "a");
    BOOST_TEST(feed.items[2].missed == 2U);
    BOOST_TEST(metric(*tower, "updates_dropped") == 1U);
}

BOOST_FIXTURE_TEST_CASE(an_update_over_1200_bytes_is_reported_to_its_publisher, network) {
    const auto car = node("car1");
    const auto tower = node("tower");
    feed_log feed;
    until_bound(feed, *tower, "all:place");
    run_until(io, [&] { return metric(*car, "group_leases") == 1; });
    car->update("place", std::string(1200, 'x'));
    car->update("place", 1);
    run_until(io, [&] { return !feed.items.empty(); });
    BOOST_TEST(updates(feed).front() == "car1 2");
    BOOST_TEST(metric(*car, "updates_too_large") == 1U);
    BOOST_TEST(logged("too_large: UPDATE car1:place has "));
}

BOOST_FIXTURE_TEST_CASE(where_it_is_off_there_is_no_way_to_all, network) {
    cles::service tower{io, {.name = "tower"}};
    for (const auto& [noun, options] :
         {std::pair{"all:place", cles::bind_options{}}, std::pair{"car1:place", by_group}}) {
        feed_log feed;
        feed.bind(tower, noun, options);
        run_until(io, [&] { return feed.binds != 0; });
        BOOST_TEST((feed.code == errc::no_target));
        BOOST_TEST(feed.words == "'" + std::string{noun} +
                                     "' needs multicast, which is off: set an interface in service_options::multicast");
    }
}

BOOST_FIXTURE_TEST_CASE(what_the_group_cannot_carry_is_refused, network) {
    const auto tower = node("tower");
    const auto code_of = [&](const char* noun, const cles::bind_options& options) {
        feed_log feed;
        feed.bind(*tower, noun, options);
        run_until(io, [&] { return feed.binds != 0; });
        return feed.code;
    };
    BOOST_TEST((code_of("any:place", by_group) == errc::no_target));
    BOOST_TEST((code_of("self:place", by_group) == errc::no_target));
    BOOST_TEST((code_of("all:cles", {}) == errc::bad_request));
    auto both = by_group;
    both.at("tcp://127.0.0.1:1");
    BOOST_TEST((code_of("car1:place", both) == errc::bad_request));
}

BOOST_FIXTURE_TEST_CASE(the_error_names_an_invalid_interface, network) {
    where.interface = "nowhere0";
    try {
        node("car1");
        BOOST_FAIL("joined");
    } catch (const cles::error& e) {
        BOOST_TEST(e.code().value() == ENODEV);
        BOOST_TEST(e.message().find("cannot join 239.255.25.37:" + std::to_string(where.port) + " on 'nowhere0': ") ==
                   0U);
    }
    where.required = false;
    const auto car = node("car1");
    BOOST_TEST(logged("no multicast: cannot join"));
    car->update("place", 1);
}

BOOST_FIXTURE_TEST_CASE(the_error_names_an_invalid_group, network) {
    where.group = "10.0.0.1";
    try {
        node("car1");
        BOOST_FAIL("joined");
    } catch (const cles::error& e) {
        BOOST_TEST((e.code() == errc::invalid_url));
        BOOST_TEST(e.message().find("'10.0.0.1' is not an IPv4 multicast group") == 0U);
    }
}

BOOST_FIXTURE_TEST_CASE(a_feed_may_be_closed_from_inside_its_event_and_outlive_the_service, network) {
    const auto car = node("car1");
    auto tower = node("tower");
    feed_log other;
    until_bound(other, *tower, "all:place");
    bool closed = false;
    cles::feed<cles::json_text> feed;
    tower->async_bind("all:place", [&](boost::system::error_code code, cles::feed<cles::json_text> made) {
        BOOST_REQUIRE(!code);
        feed = std::move(made);
        feed.async_next([&](boost::system::error_code failed, const cles::feed_item<cles::json_text>&) {
            BOOST_TEST(!failed);
            feed.close();
            closed = true;
        });
    });
    run_until(io, [&] { return feed.is_open(); });
    run_until(io, [&] { return metric(*car, "group_leases") == 1; });
    car->update("place", 1);
    run_until(io, [&] { return closed && other.items.size() == 1; });
    tower.reset();
    run_until(io, [&] { return other.is_over(); });
    BOOST_TEST((other.code == errc::stopped));
}

BOOST_AUTO_TEST_SUITE_END()
