// SPDX-License-Identifier: BSL-1.0
// Requests and bindings by datagram, over networks without impairments.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/impaired_path.hpp"
#include "support/localization.hpp"
#include "support/metric.hpp"
#include "support/node.hpp"
#include "support/reply_text.hpp"
#include "support/run_until.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(udp)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;
using cles::feed_event;

namespace {

/// A client with a plain socket.
class plain_client {
  public:
    plain_client(asio::io_context& io, const std::string& url) : io_(io), socket_(io, asio::ip::udp::v4()) {
        const auto where = cles::parse_url(url);
        socket_.connect({asio::ip::make_address(where.host), where.port});
        socket_.non_blocking(true);
    }
    void send(std::string_view datagram) { socket_.send(asio::buffer(datagram.data(), datagram.size())); }
    std::string receive() {
        std::array<char, 65536> buffer{};
        std::size_t count = 0;
        run_until(io_, [&] {
            boost::system::error_code code;
            count = socket_.receive(asio::buffer(buffer), 0, code);
            return !code;
        });
        return {buffer.data(), count};
    }
    std::string ask(std::string_view datagram) {
        send(datagram);
        return receive();
    }
    /// Nothing arrives.
    bool silent() {
        run_ready(io_);
        return socket_.available() == 0;
    }

  private:
    asio::io_context& io_;
    asio::ip::udp::socket socket_;
};

} // namespace

struct nodes {
    explicit nodes(carrier kind = carrier::udp4, const cles::limits& bounds = {})
        : car(std::make_unique<cles::service>(io, listening("car1", kind, bounds))) {
        tower = std::make_unique<cles::service>(io, knowing("tower", *car, bounds));
        prepare();
    }
    void prepare() {
        car->on_pull("localization", [] { return localization{1.5, 52.25, 13.125}; });
        car->on_pull("long", [] { return std::string(1300, 'x'); });
        car->on_push("count", [this] { return ++runs; });
        car->on_delegate("drive", [this](const cles::request&, cles::responder r) { job.emplace(std::move(r)); });
        car->on_update("notice", [](const cles::request&) {});
        car->on_bind("place");
    }
    [[nodiscard]] std::string url() const { return car->endpoints().front(); }

    asio::io_context io;
    int runs = 0;
    std::optional<cles::responder> job;
    std::unique_ptr<cles::service> car;
    std::unique_ptr<cles::service> tower;
};

CLES_DATA_TEST_CASE(all_five_verbs_cross, every_datagram, kind) {
    nodes n{kind};
    answer<localization> pulled;
    answer<int> pushed;
    answer<> delegated;
    answer<> updated;
    feed_log feed;
    std::vector<double> reports;
    n.tower->async_pull<localization>("car1:localization", pulled.take());
    n.tower->async_push<int>("car1:count", cles::json_text{"{}"}, pushed.options(), pushed.take());
    n.tower->async_delegate("car1:drive", cles::json_text{"{}"},
                            delegated.options().on_progress([&](double f, std::string_view) { reports.push_back(f); }),
                            delegated.take());
    feed.bind(*n.tower, "car1:notice");
    run_until(n.io, [&] { return pulled.done() && pushed.done() && n.job && feed.bound; });
    n.tower->async_request("UPDATE car1:notice {\"a\":1}", updated.take());
    n.job->progress(0.5);
    n.job->done(cles::json_text{"[7]"});
    run_until(n.io, [&] { return delegated.done() && updated.done() && feed.items.size() == 1; });
    BOOST_TEST((pulled.value == localization{1.5, 52.25, 13.125}));
    BOOST_TEST(!pushed.code, pushed.code.message() << ": " << pushed.words);
    BOOST_TEST(pushed.value == 1);
    BOOST_TEST(delegated.value.text == "[7]");
    BOOST_TEST((reports == std::vector<double>{0.5}));
    BOOST_TEST(feed.items[0].value.text == "{\"a\":1}");
}

BOOST_AUTO_TEST_CASE(a_node_tells_its_udp_endpoint_and_who_asks) {
    nodes n;
    std::string seen;
    n.car->on_pull("who", [&](const cles::request& r) {
        seen = r.peer().transport + " " + (r.peer().local ? "local" : "far");
        return r.peer().address;
    });
    answer<std::string> who;
    answer<> self;
    n.tower->async_pull<std::string>("car1:who", who.take());
    n.tower->async_pull("car1:cles", self.take());
    run_until(n.io, [&] { return who.done() && self.done(); });
    BOOST_TEST(seen == "udp local");
    BOOST_TEST(who.value.starts_with("udp://127.0.0.1:"));
    BOOST_TEST(self.value.text.find("\"endpoints\":[\"" + n.url() + "\"]") != std::string::npos, self.value.text);
}

BOOST_AUTO_TEST_CASE(listening_beyond_loopback_needs_the_insecure_option) {
    asio::io_context io;
    for (const auto* where : {"udp://0.0.0.0:0", "udp://[::]:0"}) {
        BOOST_CHECK_EXCEPTION((cles::service{io, {.name = "car1", .listen = {where}}}), cles::error,
                              [](const cles::error& e) { return e.code() == errc::insecure_listen; });
        BOOST_CHECK_NO_THROW((cles::service{io, {.name = "car1", .listen = {where}, .insecure = true}}));
    }
}

BOOST_AUTO_TEST_CASE(what_is_no_network_is_refused_when_the_service_is_made) {
    asio::io_context io;
    BOOST_CHECK_EXCEPTION((cles::service{io, {.name = "car1", .networks = {"10.0.0.0/99"}}}), cles::error,
                          [](const cles::error& e) { return e.code() == errc::invalid_url; });
}

BOOST_AUTO_TEST_CASE(what_is_too_large_fails_with_a_hint_to_tcp_and_is_not_split) {
    nodes n;
    answer<> reply;
    answer<> request;
    n.tower->async_pull("car1:long", reply.options(), reply.take());
    n.tower->async_push("car1:count", std::string(1300, 'x'), request.options(), request.take());
    BOOST_TEST(!request.done()); // never inside the call
    run_until(n.io, [&] { return reply.done() && request.done(); });
    BOOST_TEST(reply.code == errc::too_large);
    BOOST_TEST(reply.words.find("use TCP") != std::string::npos, reply.words);
    BOOST_TEST(request.code == errc::too_large);
    BOOST_TEST(request.words.find("use TCP") != std::string::npos, request.words);
    BOOST_TEST(n.runs == 0);
}

BOOST_AUTO_TEST_CASE(an_update_that_is_too_large_shows_as_a_gap) {
    nodes n;
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    n.car->update("place", 1);
    n.car->update("place", std::string(1300, 'x'));
    n.car->update("place", 3);
    run_until(n.io, [&] { return feed.count(feed_event::update) == 2; });
    BOOST_TEST(feed.missed() == 1U);
    BOOST_TEST(metric(*n.car, "updates_too_large") == 1U);
}

BOOST_AUTO_TEST_CASE(a_person_asks_with_a_plain_socket) {
    nodes n;
    plain_client person{n.io, n.url()};
    BOOST_TEST(person.ask("PULL self:localization") == "{\"utc\":1.5,\"lat\":52.25,\"lon\":13.125}\n");
    BOOST_TEST(person.ask("PULL car1:localization id=7\n").starts_with("id=7 {\"utc\""));
    BOOST_TEST(kind_of(person.ask("nonsense")) == "bad_request");
    BOOST_TEST(kind_of(person.ask("PULL car1:localization\nPULL car1:localization")) == "bad_request");
    BOOST_TEST(kind_of(person.ask("PULL car1:localization id=7 " + std::string(2000, 'x'))) == "id=7 too_large");
    person.send("id=9 {}");
    person.send("{\"error\":\"busy\"}");
    person.send("");
    BOOST_TEST(person.silent());
    BOOST_TEST(person.ask("BIND self:place") == "{}\n");
    n.car->update("place", 7);
    BOOST_TEST(person.receive().starts_with("UPDATE car1:place seq=1 epoch="));
    BOOST_TEST(person.ask("BIND self:place lease=0") == "{}\n");
    n.car->update("place", 8);
    BOOST_TEST(person.silent());
}

BOOST_AUTO_TEST_CASE(a_repeated_push_runs_once) {
    nodes n;
    plain_client one{n.io, n.url()};
    plain_client two{n.io, n.url()};
    BOOST_TEST(one.ask("PUSH car1:count id=7 {}") == "id=7 {\"value\":1}\n");
    BOOST_TEST(one.ask("PUSH car1:count id=7 {}\n") == "id=7 {\"value\":1}\n");
    BOOST_TEST(two.ask("PUSH car1:count id=7 {}") == "id=7 {\"value\":2}\n"); // from another port
    BOOST_TEST(n.runs == 2);
    BOOST_TEST(metric(*n.car, "requests_repeated") == 1U);
}

BOOST_AUTO_TEST_CASE(a_request_is_withdrawn_by_its_cancellation_slot) {
    nodes n;
    bool stopped = false;
    answer<> result;
    asio::cancellation_signal signal;
    n.tower->async_delegate("car1:drive", cles::json_text{"{}"},
                            asio::bind_cancellation_slot(signal.slot(), result.take()));
    run_until(n.io, [&] { return n.job.has_value(); });
    n.job->on_stop([&] { stopped = true; });
    signal.emit(asio::cancellation_type::terminal);
    run_until(n.io, [&] { return stopped; });
    BOOST_TEST(result.code == errc::cancelled);
}

BOOST_AUTO_TEST_CASE(without_a_listener_the_deadline_ends_it) {
    nodes n;
    n.car.reset();
    answer<> result;
    n.tower->async_pull("car1:localization", result.options().deadline(300ms), result.take());
    run_until(n.io, [&] { return result.done(); });
    BOOST_TEST(result.code == errc::deadline);
}

BOOST_AUTO_TEST_CASE(a_node_that_returns_in_time_replies_to_what_was_sent_before) {
    nodes n;
    const auto where = n.url();
    n.car.reset();
    answer<> result;
    n.tower->async_pull("car1:localization", result.options().deadline(10s), result.take());
    run_ready(n.io);
    n.car = std::make_unique<cles::service>(n.io, cles::service_options{.name = "car1", .listen = {where}});
    n.prepare();
    run_until(n.io, [&] { return result.done(); });
    BOOST_TEST(!result.code);
}

// -- leases ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_feed_renews_and_its_binding_stays) {
    nodes n{carrier::udp4, {.lease = 150ms}};
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    const auto end = std::chrono::steady_clock::now() + 600ms;
    int published = 0;
    while (std::chrono::steady_clock::now() < end) {
        n.car->update("place", ++published);
        run_until(n.io, [&] { return feed.items.size() == static_cast<std::size_t>(published); });
    }
    BOOST_TEST(feed.count(feed_event::update) == feed.items.size()); // no loss, no rebinding, no gap
    BOOST_TEST(metric(*n.car, "leases_expired") == 0U);
}

BOOST_AUTO_TEST_CASE(a_renewals_answer_may_be_as_deep_as_the_first) {
    nodes n{carrier::udp4, {.lease = 60ms}};
    const cles::json_text deepest{std::string(32, '[') + std::string(32, ']')};
    n.car->update("place", std::map<std::string, cles::json_text>{{"inside", deepest}});
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return metric(*n.car, "BIND") >= 3; }); // itself and two renewals
    BOOST_TEST(metric(*n.tower, "replies_dropped") == 0U);
    BOOST_TEST(metric(*n.car, "leases_expired") == 0U);
}

BOOST_AUTO_TEST_CASE(a_failed_subscriber_is_unbound_when_its_lease_expires) {
    nodes n{carrier::udp4, {.lease = 100ms}};
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    n.tower.reset();
    run_until(n.io, [&] { return metric(*n.car, "leases_expired") == 1; });
    n.car->update("place", 1);
    run_ready(n.io);
    BOOST_TEST(metric(*n.car, "updates_delivered") == 0U);
}

BOOST_AUTO_TEST_CASE(a_closed_feed_is_unbound_at_once) {
    nodes n;
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    feed.close();
    run_until(n.io, [&] { return feed.is_over(); });
    run_ready(n.io);
    n.car->update("place", 1);
    run_ready(n.io);
    BOOST_TEST(metric(*n.car, "updates_delivered") == 0U);
    BOOST_TEST(metric(*n.car, "leases_expired") == 0U);
}

BOOST_AUTO_TEST_CASE(a_lost_publisher_is_reported_when_the_lease_is_over_and_bound_again) {
    nodes n{carrier::udp4, {.lease = 300ms}};
    impaired_path path{n.io, n.url(), {}, 1};
    n.tower->set_peer("car1", path.url());
    n.car->update("place", 1);
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    path.set({.loss = 1});
    const auto dark = std::chrono::steady_clock::now();
    run_until(n.io, [&] { return feed.count(feed_event::lost) == 1; });
    BOOST_TEST((std::chrono::steady_clock::now() - dark >= 100ms)); // at least what remained of the lease
    n.car->update("place", 2);
    path.set({});
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 1 && feed.count(feed_event::current) == 2; });
    n.car->update("place", 3);
    run_until(n.io, [&] { return feed.count(feed_event::update) == 1; });
    BOOST_TEST(feed.items.back().value.text == "{\"value\":3}");
}

BOOST_AUTO_TEST_CASE(a_lost_publisher_is_bound_again_though_its_last_value_is_too_large_for_the_answer) {
    nodes n{carrier::udp4, {.lease = 300ms}};
    impaired_path path{n.io, n.url(), {}, 1};
    n.tower->set_peer("car1", path.url());
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    path.set({.loss = 1});
    run_until(n.io, [&] { return feed.count(feed_event::lost) == 1; });
    n.car->update("place", std::string(1300, 'x'));
    path.set({});
    run_until(n.io, [&] { return feed.count(feed_event::rebound) == 1; });
    n.car->update("place", 3);
    run_until(n.io, [&] { return feed.count(feed_event::update) == 1; });
    BOOST_TEST(feed.items.back().value.text == "{\"value\":3}");
    BOOST_TEST(feed.count(feed_event::current) == 0U);
}

BOOST_AUTO_TEST_CASE(a_publisher_that_was_restarted_is_bound_again_by_the_renewal) {
    nodes n{carrier::udp4, {.lease = 200ms}};
    feed_log feed;
    feed.bind(*n.tower, "car1:place");
    run_until(n.io, [&] { return feed.bound; });
    const auto where = n.url();
    n.car.reset();
    n.car = std::make_unique<cles::service>(n.io, cles::service_options{.name = "car1", .listen = {where}});
    n.car->on_bind("place");
    int published = 0;
    run_until(n.io, [&] {
        n.car->update("place", ++published);
        return feed.count(feed_event::update) > 3;
    });
    BOOST_TEST(feed.code == boost::system::error_code{});
}

// -- bounds ----------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(past_the_sources_that_there_may_be_new_ones_are_busy) {
    nodes n{carrier::udp4, {.links = 2}};
    plain_client one{n.io, n.url()};
    plain_client two{n.io, n.url()};
    plain_client three{n.io, n.url()};
    BOOST_TEST(kind_of(one.ask("PUSH car1:count id=1")) == "id=1 ok");
    BOOST_TEST(kind_of(two.ask("BIND car1:place id=2")) == "id=2 ok");
    const auto told = three.ask("PULL car1:localization id=3");
    BOOST_TEST(kind_of(told) == "id=3 busy");
    BOOST_TEST(read_reply(told).retry_ms.value_or(0) == 1000U);
    three.send("id=9 {}");
    {
        const bool quiet = three.silent();
        BOOST_TEST(quiet, (quiet ? std::string{} : three.receive()));
    }
    three.send("PUSH car1:count id=10 reply=no");
    {
        const bool quiet = three.silent();
        BOOST_TEST(quiet, (quiet ? std::string{} : three.receive()));
    }
    BOOST_TEST(n.runs == 1);
    BOOST_TEST(kind_of(two.ask("BIND car1:place id=4 lease=0")) == "id=4 ok"); // nothing is kept for it any more
    BOOST_TEST(kind_of(three.ask("PULL car1:localization id=5")) == "id=5 ok");
}

BOOST_AUTO_TEST_CASE(sources_that_only_pull_use_no_capacity_of_others) {
    nodes n{carrier::udp4, {.links = 4}};
    for (int i = 0; i < 40; ++i) {
        plain_client passer_by{n.io, n.url()};
        BOOST_TEST(kind_of(passer_by.ask("PULL car1:localization")) == "ok");
    }
    BOOST_TEST(metric(*n.car, "links_refused") == 0U);
}

BOOST_AUTO_TEST_CASE(sources_are_counted_apart_from_links) {
    asio::io_context io;
    cles::limits bounds{.links = 1};
    auto options = listening("car1", carrier::tcp4, bounds);
    options.listen.push_back(fresh_address(carrier::udp4));
    cles::service car{io, options};
    car.on_push("count", [] {});
    plain_client source{io, car.endpoints().back()};
    BOOST_TEST(kind_of(source.ask("PUSH car1:count id=1")) == "id=1 ok");
    cles::service tower{io, knowing("tower", car)};
    answer<> result;
    tower.async_pull("car1:cles", result.take());
    run_until(io, [&] { return result.done(); });
    BOOST_TEST(!result.code);
}

BOOST_AUTO_TEST_SUITE_END()
