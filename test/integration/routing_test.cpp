// SPDX-License-Identifier: BSL-1.0
// Services that route for their clients: a client of one reaches every node that it knows.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/feed_log.hpp"
#include "support/group_address.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(routing)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

namespace {

/// A hub that routes, and a client that knows no other node. The others run on a separate context, so they are reached
/// by links.
struct fixture {
    std::unique_ptr<cles::service> serving(const std::string& name, bool in_group = true,
                                           cles::service_options options = {}) {
        options.name = name;
        options.listen = {"tcp://127.0.0.1:0"};
        if (in_group) {
            options.multicast = where;
        }
        auto made = std::make_unique<cles::service>(there, std::move(options));
        made->on_pull("who", [name] { return name; });
        return made;
    }
    /// The hub, from this call on.
    cles::service& start_hub(bool in_group = true) {
        cles::service_options options{.name = "hub"};
        options.listen = {"tcp://127.0.0.1:0"};
        options.routing = cles::routing();
        if (in_group) {
            options.multicast = where;
        }
        hub.emplace(here, std::move(options));
        cles::service_options asking{.name = "client"};
        asking.peers.emplace("hub", hub->endpoints().front());
        client.emplace(here, std::move(asking));
        return *hub;
    }
    cles::call_options by_hub(std::string& words) const {
        return cles::call_options{}.at(hub->endpoints().front()).diagnostics(words);
    }

    template <class Condition>
    void until(Condition&& holds) {
        run_until(here, [&] {
            there.restart();
            there.poll();
            return holds();
        });
    }
    struct outcome {
        bool ended = false;
        boost::system::error_code code;
        std::string text;
        std::string why;
    };
    std::shared_ptr<outcome> ask(const std::string& command, std::chrono::milliseconds deadline = 0ms) {
        auto result = std::make_shared<outcome>();
        auto options = by_hub(result->why);
        options.deadline(deadline);
        client->async_request(command, options, [result](boost::system::error_code code, const cles::json_text& reply) {
            result->ended = true;
            result->code = code;
            result->text = reply.text;
        });
        return result;
    }
    outcome asked(const std::string& command, std::chrono::milliseconds deadline = 0ms) {
        const auto result = ask(command, deadline);
        until([&] { return result->ended; });
        return *result;
    }
    /// Until the hub knows the tasks of this many nodes.
    void until_all_answer(std::size_t others, const std::string& command) {
        until([&] {
            const auto answer = asked(command);
            std::size_t count = 0;
            for (auto at = answer.text.find("car"); at != std::string::npos; at = answer.text.find("\"car", at + 4)) {
                ++count;
            }
            return !answer.code && count >= others;
        });
    }

    cles::multicast_options where = fresh_group();
    asio::io_context here;
    asio::io_context there;
    std::optional<cles::service> hub;
    std::optional<cles::service> client;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_client_of_the_hub_reaches_a_node_that_only_the_hub_knows, fixture) {
    const auto car = serving("car1", false);
    car->on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
    start_hub(false).set_peer("car1", car->endpoints().front());
    BOOST_TEST(asked("PULL car1:who").text == "{\"value\":\"car1\"}");
    BOOST_TEST(asked("PUSH car1:echo {\"x\":[1,2]}").text == "{\"x\":[1,2]}");
    const auto none = asked("PULL car1:nothing");
    BOOST_TEST((none.code == errc::no_task));
    BOOST_TEST(none.why == "car1 has no PULL 'nothing'");
    BOOST_TEST((asked("PULL car9:who").code == errc::no_target));
    BOOST_TEST((asked("PULL any:who").code == errc::no_target)); // no node has announced itself
}

BOOST_FIXTURE_TEST_CASE(progress_and_cancellation_pass_the_hub, fixture) {
    const auto car = serving("car1", false);
    std::optional<cles::responder> job;
    bool stopped = false;
    car->on_delegate("work", [&](const cles::request&, cles::responder r) {
        r.on_stop([&] { stopped = true; });
        job.emplace(std::move(r));
    });
    start_hub(false).set_peer("car1", car->endpoints().front());
    double reported = 0;
    answer<> result;
    auto options = by_hub(result.words);
    options.on_progress([&](double fraction, std::string_view) { reported = fraction; });
    client->async_delegate("car1:work", 1, options, result.take());
    until([&] { return job.has_value(); });
    job->progress(0.5);
    until([&] { return reported == 0.5; });
    job->done(2);
    until([&] { return result.done(); });
    BOOST_TEST(result.value.text == "{\"value\":2}");
    job.reset();
    const auto late = ask("DELEGATE car1:work", 300ms);
    until([&] { return late->ended && stopped; });
    BOOST_TEST((late->code == errc::deadline));
}

BOOST_FIXTURE_TEST_CASE(a_node_whose_listener_is_closed_is_unavailable_at_once, fixture) {
    auto car = serving("car1", false);
    const auto where_it_was = car->endpoints().front();
    car.reset();
    start_hub(false).set_peer("car1", where_it_was);
    const auto answer = asked("PULL car1:who");
    BOOST_TEST((answer.code == errc::unavailable));
    BOOST_TEST(answer.why.find("car1") != std::string::npos, answer.why);
}

BOOST_FIXTURE_TEST_CASE(two_who_each_know_a_name_at_the_other_do_not_go_round, fixture) {
    cles::service_options options{.name = "other"};
    options.listen = {"tcp://127.0.0.1:0"};
    options.routing = cles::routing();
    cles::service other{there, std::move(options)};
    start_hub(false).set_peer("car1", other.endpoints().front());
    other.set_peer("car1", hub->endpoints().front());
    const auto answer = asked("PULL car1:who");
    BOOST_TEST((answer.code == errc::no_target));
    BOOST_TEST(answer.why == "hub has forwarded this request for 'car1' before: the nodes in 'via' form a loop");
}

BOOST_FIXTURE_TEST_CASE(a_cold_hub_answers_any_when_its_first_round_is_over, fixture) {
    const auto one = serving("car1");
    const auto two = serving("car2");
    start_hub();
    const auto answer = asked("PULL any:who");
    BOOST_TEST(!answer.code);
    BOOST_TEST((answer.text == "{\"value\":\"car1\"}" || answer.text == "{\"value\":\"car2\"}"), answer.text);
}

BOOST_FIXTURE_TEST_CASE(all_are_asked_and_who_is_lost_is_among_the_errors, fixture) {
    const auto one = serving("car1");
    auto two = serving("car2");
    two->on_delegate("work", [](const cles::request&, cles::responder) {}); // ends at once: failed
    start_hub().on_pull("who", [] { return 0; });
    until_all_answer(2, "PULL all:who");
    BOOST_TEST(asked("PULL all:who").text == R"({"results":{"car1":{"value":"car1"},"car2":{"value":"car2"},)"
                                             R"("hub":{"value":0}},"errors":{}})");
    const auto failed = asked("DELEGATE all:work");
    BOOST_TEST(failed.text.starts_with(R"({"results":{},"errors":{"car2":{"error":"failed")"), failed.text);
}

BOOST_FIXTURE_TEST_CASE(any_continues_with_another_when_a_node_fails, fixture) {
    const auto one = serving("car1");
    auto two = serving("car2");
    start_hub();
    until_all_answer(2, "PULL all:who");
    std::set<std::string> seen;
    until([&] {
        seen.insert(asked("PULL any:who").text);
        return seen.size() == 2;
    });
    two.reset();
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(asked("PULL any:who").text == "{\"value\":\"car1\"}");
    }
}

// The chosen node has reached its limit of links and reports that in a line that replies to no request.
BOOST_FIXTURE_TEST_CASE(any_continues_with_another_when_a_full_node_refuses_the_link, fixture) {
    cles::service_options loaded;
    loaded.load = [] { return cles::node_load{.queued = 50, .running = 1, .workers = 1}; };
    const auto second = serving("car2", true, std::move(loaded));
    start_hub();
    until_all_answer(1, "PULL all:who");
    cles::service_options small;
    small.limits.links = 1;
    small.load = [] { return cles::node_load{.workers = 1}; };
    const auto first = serving("car1", true, std::move(small));
    first->on_bind("place");
    scripted_peer inside{there, first->endpoints().front()};
    BOOST_TEST(inside.ask("BIND self:place") == "{}");
    // It offers the same as car2, so it need not be asked for its tasks first.
    std::string metrics;
    until([&] {
        const auto answer = asked("PULL any:who");
        BOOST_TEST(!answer.code, answer.why);
        BOOST_TEST(answer.text == "{\"value\":\"car2\"}");
        metrics = inside.ask("PULL self:cles/metrics");
        return metrics.find("\"links_refused\":0,") == std::string::npos;
    });
    // By its name it is busy, as car1 reports.
    const auto named = asked("PULL car1:who");
    BOOST_TEST((named.code == errc::busy), named.why);
    BOOST_TEST(named.why == "car1 has reached its limit of links");
}

BOOST_FIXTURE_TEST_CASE(the_hub_asks_any_and_all_for_itself_too, fixture) {
    const auto one = serving("car1");
    start_hub();
    until_all_answer(1, "PULL all:who");
    answer<> any;
    answer<> all;
    hub->async_pull("any:who", any.take());
    hub->async_pull("all:who", all.take());
    until([&] { return any.done() && all.done(); });
    BOOST_TEST(any.value.text == "{\"value\":\"car1\"}");
    BOOST_TEST(all.value.text == R"({"results":{"car1":{"value":"car1"}},"errors":{}})");
}

BOOST_FIXTURE_TEST_CASE(a_binding_is_held_upstream_once_and_made_again_when_the_node_is_back, fixture) {
    auto car = serving("car1", false);
    car->update("pose", 1);
    start_hub(false).set_peer("car1", car->endpoints().front());
    std::vector<std::string> seen;
    auto options = cles::bind_options{}.at(hub->endpoints().front());
    std::optional<cles::feed<cles::json_text>> feed;
    client->async_bind("car1:pose", options, [&](boost::system::error_code code, cles::feed<cles::json_text> made) {
        BOOST_TEST(!code);
        feed.emplace(std::move(made));
    });
    until([&] { return feed.has_value(); });
    std::function<void(boost::system::error_code, cles::feed_item<cles::json_text>)> take =
        [&](boost::system::error_code code, const cles::feed_item<cles::json_text>& item) {
            if (!code) {
                seen.push_back(item.has_value() ? std::string{item.publisher} + item.value.text : "-");
                feed->async_next(take);
            }
        };
    feed->async_next(take);
    car->update("pose", 2);
    until([&] { return seen.size() == 2; });
    BOOST_TEST(seen[0] == "{\"value\":1}");
    BOOST_TEST(seen[1] == "car1{\"value\":2}");

    const auto where_it_was = car->endpoints().front();
    car.reset();
    until([&] {
        there.restart();
        there.poll();
        return true;
    });
    cles::service_options again{.name = "car1"};
    again.listen = {where_it_was};
    cles::service back{there, std::move(again)};
    back.update("pose", "again");
    until([&] {
        back.update("pose", "again");
        return seen.size() > 2;
    });
    BOOST_TEST(seen[2] == "car1{\"value\":\"again\"}");
    feed.reset();
}

BOOST_FIXTURE_TEST_CASE(what_was_published_before_the_node_was_bound_again_reaches_the_binders, fixture) {
    auto car = serving("car1", false);
    car->update("pose", 1);
    start_hub(false).set_peer("car1", car->endpoints().front());
    feed_log feed;
    feed.bind(*client, "car1:pose", cles::bind_options{}.at(hub->endpoints().front()));
    until([&] { return feed.bound; });
    car->update("pose", 2);
    until([&] { return feed.bodies().size() == 1; });
    const auto where_it_was = car->endpoints().front();
    car.reset();
    cles::service_options again{.name = "car1"};
    again.listen = {where_it_was};
    cles::service back{there, std::move(again)};
    back.update("pose", "again"); // and never more
    until([&] { return feed.bodies().size() == 2; });
    BOOST_TEST(feed.bodies().back() == "{\"value\":\"again\"}");
    BOOST_TEST(feed.items.back().seq == 1U);
    BOOST_TEST(feed.count(cles::feed_event::gap) == 0U);
    // A client that binds now learns which update that was.
    scripted_peer raw{here, hub->endpoints().front()};
    raw.send("BIND car1:pose id=5 mark=yes\n");
    std::string reply;
    until([&] {
        reply = raw.unread();
        return raw.ended() || reply.ends_with('\n');
    });
    BOOST_TEST(reply.starts_with("id=5 seq=1 epoch="), reply);
    BOOST_TEST(reply.ends_with(" {\"value\":\"again\"}\n"), reply);
    feed.close();
}

BOOST_FIXTURE_TEST_CASE(a_binding_of_all_has_each_publisher_and_later_ones_too, fixture) {
    const auto one = serving("car1");
    one->update("pose", 1);
    start_hub();
    until_all_answer(1, "PULL all:who");
    std::set<std::string> seen;
    std::optional<cles::feed<cles::json_text>> feed;
    client->async_bind("all:pose", cles::bind_options{}.at(hub->endpoints().front()),
                       [&](boost::system::error_code code, cles::feed<cles::json_text> made) {
                           BOOST_TEST(!code);
                           feed.emplace(std::move(made));
                       });
    until([&] { return feed.has_value(); });
    std::function<void(boost::system::error_code, cles::feed_item<cles::json_text>)> take =
        [&](boost::system::error_code code, const cles::feed_item<cles::json_text>& item) {
            if (!code) {
                seen.insert(std::string{item.publisher});
                feed->async_next(take);
            }
        };
    feed->async_next(take);
    until([&] {
        one->update("pose", 2);
        return seen.contains("car1");
    });
    const auto two = serving("car2");
    two->update("pose", 1);
    until([&] {
        two->update("pose", 2);
        return seen.contains("car2");
    });
    feed.reset();
}

BOOST_FIXTURE_TEST_CASE(a_nodes_load_is_what_its_program_reports, fixture) {
    cles::service_options options{.name = "car1"};
    options.listen = {"tcp://127.0.0.1:0"};
    options.multicast = where;
    options.load = [] { return cles::node_load{.queued = 3, .running = 2, .workers = 4, .service_us = 1'500}; };
    cles::service car{there, std::move(options)};
    start_hub();
    until([&] { return hub->peers().size() == 1; });
    const auto load = hub->peers().front().load;
    BOOST_TEST((load == cles::node_load{.queued = 3, .running = 2, .workers = 4, .service_us = 1'500}));
    const auto told = asked("PULL car1:cles").text;
    BOOST_TEST(told.find(R"("load":{"queued":3,"running":2,"workers":4,"service_us":1500})") != std::string::npos,
               told);
}

BOOST_FIXTURE_TEST_CASE(a_service_that_does_not_route_knows_no_way, fixture) {
    const auto car = serving("car1", false);
    start_hub(false);
    cles::service_options options{.name = "plain"};
    options.listen = {"tcp://127.0.0.1:0"};
    options.peers.emplace("car1", car->endpoints().front());
    cles::service plain{here, std::move(options)};
    for (const std::string_view noun : {"car1:who", "any:who", "all:who"}) {
        answer<> result;
        client->async_pull(noun, cles::call_options{}.at(plain.endpoints().front()), result.take());
        until([&] { return result.done(); });
        BOOST_TEST((result.code == errc::no_target), noun);
    }
}

BOOST_AUTO_TEST_SUITE_END()
