// SPDX-License-Identifier: BSL-1.0
// Services that discover each other by seeds, over TCP on loopback, without multicast.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(gossip)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using cles::errc;

namespace {

struct fixture {
    /// A service with its own context; those of one context would find each other without any URL.
    std::unique_ptr<cles::service> make(const std::string& name, std::vector<std::string> seeds, bool gossip = true) {
        contexts.push_back(std::make_unique<asio::io_context>());
        cles::service_options options{.name = name, .listen = {"tcp://127.0.0.1:0"}};
        if (gossip) {
            options.gossip = cles::gossip(std::move(seeds));
        }
        auto made = std::make_unique<cles::service>(*contexts.back(), std::move(options));
        made->on_pull("who", [name] { return name; });
        return made;
    }
    template <class Condition>
    void until(Condition&& holds, const std::source_location& where = std::source_location::current()) {
        run_until(
            idle,
            [&] {
                for (const auto& io : contexts) {
                    io->restart();
                    io->poll();
                }
                return holds();
            },
            patience, where);
    }
    static bool knows(const cles::service& s, std::string_view name) {
        const auto all = s.peers();
        return std::any_of(all.begin(), all.end(), [&](const auto& p) { return p.node == name; });
    }
    static std::string at(const cles::service& s) { return s.endpoints().front(); }

    asio::io_context idle;
    std::vector<std::unique_ptr<asio::io_context>> contexts;
    std::unique_ptr<asio::io_context> busy; // does not run
};

} // namespace

BOOST_FIXTURE_TEST_CASE(nodes_with_a_common_seed_find_each_other_and_ask_by_name, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {at(*seed)});
    const auto car2 = make("car2", {at(*seed)});
    until([&] { return seed->peers().size() == 2 && car1->peers().size() == 2 && car2->peers().size() == 2; });
    answer<> got;
    car1->async_pull("car2:who", got.options(), got.take());
    until([&] { return got.done(); });
    BOOST_TEST(!got.code);
    BOOST_TEST(got.value.text == R"({"value":"car2"})");
}

BOOST_FIXTURE_TEST_CASE(a_request_to_a_name_that_is_not_known_yet_waits_for_the_first_answers, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {at(*seed)});
    until([&] { return knows(*seed, "car1"); });
    const auto car2 = make("car2", {at(*seed)});
    answer<> got;
    car2->async_pull("car1:who", got.options(), got.take());
    until([&] { return got.done(); });
    BOOST_TEST(!got.code);
}

BOOST_FIXTURE_TEST_CASE(a_request_waits_for_a_seed_on_a_busy_machine, fixture) {
    const auto seed = make("seed", {});
    busy = std::move(contexts.back()); // the system accepts links, which are not served yet
    contexts.pop_back();
    const auto car1 = make("car1", {at(*seed)});
    answer<> got;
    car1->async_pull("seed:who", got.options(), got.take());
    const auto begun = std::chrono::steady_clock::now();
    until([&] { return std::chrono::steady_clock::now() - begun > 700ms; });
    BOOST_TEST(!got.done());
    contexts.push_back(std::move(busy));
    until([&] { return got.done(); });
    BOOST_TEST(!got.code, got.words);
}

BOOST_FIXTURE_TEST_CASE(a_request_fails_soon_if_nothing_listens_at_the_seed, fixture) {
    const auto car1 = make("car1", {"tcp://127.0.0.1:1"});
    answer<> got;
    car1->async_pull("seed:who", got.options(), got.take());
    const auto begun = std::chrono::steady_clock::now();
    until([&] { return got.done(); });
    BOOST_TEST((got.code == errc::no_target));
    BOOST_TEST((std::chrono::steady_clock::now() - begun < 3s));
}

BOOST_FIXTURE_TEST_CASE(a_node_that_leaves_is_forgotten_at_once, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {at(*seed)});
    const auto car2 = make("car2", {at(*seed)});
    until([&] { return knows(*car1, "car2") && knows(*seed, "car2"); });
    const auto begun = std::chrono::steady_clock::now();
    car2->stop();
    until([&] { return !knows(*car1, "car2") && !knows(*seed, "car2"); });
    BOOST_TEST((std::chrono::steady_clock::now() - begun < 10s)); // 15 intervals are longer
}

BOOST_FIXTURE_TEST_CASE(a_node_that_leaves_is_forgotten_and_answers_until_it_stops, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {at(*seed)});
    const auto car2 = make("car2", {at(*seed)});
    until([&] { return knows(*car1, "car2") && knows(*car2, "car1") && knows(*seed, "car2"); });
    car2->leave();
    until([&] { return !knows(*car1, "car2") && !knows(*seed, "car2"); });
    answer<> by_url;
    auto there = by_url.options();
    there.at(at(*car2));
    car1->async_pull("self:who", there, by_url.take());
    answer<> onward;
    car2->async_pull("car1:who", onward.options(), onward.take());
    until([&] { return by_url.done() && onward.done(); });
    BOOST_TEST(by_url.value.text == R"({"value":"car2"})");
    BOOST_TEST(onward.value.text == R"({"value":"car1"})");
    BOOST_TEST(!knows(*car1, "car2"));
    BOOST_TEST(!knows(*seed, "car2"));
}

BOOST_FIXTURE_TEST_CASE(a_node_without_gossip_takes_part, fixture) {
    const auto plain = make("plain", {}, false);
    const auto car1 = make("car1", {at(*plain)});
    until([&] { return knows(*car1, "plain"); });
    const auto car2 = make("car2", {at(*car1)});
    until([&] { return knows(*car2, "plain") && knows(*car1, "car2"); });
    answer<> got;
    car2->async_pull("plain:who", got.options(), got.take());
    until([&] { return got.done(); });
    BOOST_TEST(!got.code);
    BOOST_TEST(plain->peers().empty()); // it does not take part in gossip
}

BOOST_FIXTURE_TEST_CASE(a_plain_table_is_answered_with_and_without_since, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {at(*seed)});
    until([&] { return knows(*seed, "car1") && knows(*car1, "seed"); });
    answer<> got;
    seed->async_pull("self:cles/peers", got.options(), got.take());
    until([&] { return got.done(); });
    BOOST_TEST(got.value.text.starts_with(R"({"peers":[{"node":"car1","endpoints":[")"));
    BOOST_TEST(got.value.text.find("next") == std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(seeds_may_be_given_while_it_runs, fixture) {
    const auto seed = make("seed", {});
    const auto car1 = make("car1", {}, false);
    car1->set_gossip(cles::gossip({at(*seed)}));
    until([&] { return knows(*car1, "seed") && knows(*seed, "car1"); });
}

BOOST_FIXTURE_TEST_CASE(the_second_of_a_name_is_reported_and_never_asked, fixture) {
    const auto seed = make("seed", {});
    const auto first = make("car1", {at(*seed)});
    until([&] { return knows(*seed, "car1"); });
    const auto second = make("car1", {at(*seed)});
    until([&] {
        const auto all = seed->peers();
        return std::any_of(all.begin(), all.end(), [](const auto& p) { return p.state == cles::peer_state::clash; });
    });
    const auto all = seed->peers();
    BOOST_TEST(all.size() == 2U);
    BOOST_TEST(all.front().endpoints.front() == at(*first));
}

BOOST_FIXTURE_TEST_CASE(a_seed_that_is_no_url_is_refused, fixture) {
    BOOST_CHECK_THROW(make("car1", {"nothing"}), cles::error);
    BOOST_CHECK_THROW(make("car1", {"pigeon://here"}), cles::error);
    const auto car1 = make("car1", {});
    BOOST_CHECK_THROW(car1->set_gossip(cles::gossip({"nothing"})), cles::error);
}

BOOST_FIXTURE_TEST_CASE(where_gossip_is_off_tables_are_refused, fixture) {
    const auto plain = make("plain", {}, false);
    answer<> got;
    plain->async_push("self:cles/peers", cles::json_text{R"({"peers":[]})"}, got.options(), got.take());
    until([&] { return got.done(); });
    BOOST_TEST((got.code == errc::no_task));
    const auto seed = make("seed", {});
    answer<> bad;
    seed->async_push("self:cles/peers", cles::json_text{R"({"value":1})"}, bad.options(), bad.take());
    until([&] { return bad.done(); });
    BOOST_TEST((bad.code == errc::bad_request));
}

BOOST_AUTO_TEST_SUITE_END()
