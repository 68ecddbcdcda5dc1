// SPDX-License-Identifier: BSL-1.0
// Memory that peers cause a node to use stays within its budget, and is reported.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/metric.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

BOOST_AUTO_TEST_SUITE(memory)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

constexpr std::size_t large = 256U * 1024; // of one value
constexpr std::size_t budget = 16 * large;

std::uint64_t memory(cles::service& of, const std::string& name) { return metric(of, name, "memory"); }

CLES_DATA_TEST_CASE(many_large_unread_results_stay_within_it, every_socket, kind) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", kind, {.memory = budget})};
    std::vector<cles::responder> asked;
    car.on_pull("picture", [&](const cles::request&, cles::responder r) { asked.push_back(std::move(r)); });
    car.on_pull("speed", [] { return 7; });
    constexpr std::size_t links = 3;
    constexpr std::size_t of_each = 40; // more than TCP's buffers hold
    std::vector<std::unique_ptr<scripted_peer>> greedy;
    for (std::size_t i = 0; i < links; ++i) {
        greedy.push_back(std::make_unique<scripted_peer>(io, car.endpoints().front(), buffers::small));
        for (std::size_t n = 1; n <= of_each; ++n) {
            greedy.back()->send("PULL self:picture deadline=3600000 id=" + std::to_string(n) + "\n");
        }
    }
    run_until(io, [&] { return asked.size() == links * of_each; });
    const std::string picture(large - 1000, 'x');
    std::uint64_t most = 0;
    for (std::size_t n = 0; n < of_each; ++n) { // one of each link in turn, otherwise the first ones get all of it
        for (std::size_t i = 0; i < links; ++i) {
            asked[i * of_each + n].done(picture);
            most = std::max(most, memory(car, "used"));
        }
    }
    asked.clear();
    BOOST_TEST(most <= budget);
    BOOST_TEST(most >= budget / 2);
    BOOST_TEST(memory(car, "limit") == budget);
    BOOST_TEST(memory(car, "refused") > 0U);

    // Others are served meanwhile, and so are requests about the node itself on the full links.
    scripted_peer other{io, car.endpoints().front()};
    BOOST_TEST(other.ask("PULL self:speed") == R"({"value":7})");
    for (const auto& each : greedy) {
        each->send("PULL self:cles id=99\n");
        std::size_t whole = 0;
        std::size_t refused = 0;
        std::size_t described = 0;
        while (whole + refused + described != of_each + 1) {
            const auto line = each->line();
            whole += line.size() > picture.size() ? 1 : 0;
            refused +=
                line.find(R"({"error":"busy")") != std::string::npos && line.find(R"("ran":true)") != std::string::npos
                    ? 1
                    : 0;
            described += line.starts_with(R"(id=99 {"node":"car1")") ? 1 : 0;
        }
        BOOST_TEST(described == 1U);
        BOOST_TEST(whole >= 1U);
    }
    run_until(io, [&] { return memory(car, "used") == 0; });
}

// A suspended node: its host accepts connections for it, and nothing that is sent there is ever read.
struct stopped_node {
    explicit stopped_node(boost::asio::io_context& io) : door{io} {
        const boost::asio::ip::tcp::endpoint anywhere{boost::asio::ip::address_v4::loopback(), 0};
        door.open(anywhere.protocol());
        door.set_option(boost::asio::socket_base::receive_buffer_size{4096});
        door.bind(anywhere);
        door.listen();
    }
    [[nodiscard]] std::string url() const { return "tcp://127.0.0.1:" + std::to_string(door.local_endpoint().port()); }

    boost::asio::ip::tcp::acceptor door;
};

BOOST_AUTO_TEST_CASE(many_large_requests_to_a_stopped_node_stay_within_its_forwarders) {
    boost::asio::io_context io;
    const stopped_node stopped{io};
    auto options = listening("hub", carrier::tcp4, {.memory = budget, .stall = 1500ms});
    options.peers.emplace("stopped", stopped.url());
    options.routing = cles::routing();
    cles::service hub{io, options};
    hub.on_pull("speed", [] { return 7; });
    cles::service tower{io, knowing("tower", hub, {.memory = 4 * budget})};
    const auto via_hub = hub.endpoints().front();
    std::vector<std::unique_ptr<answer<>>> all;
    const std::string text(large - 1000, 'x');
    std::uint64_t most = 0;
    for (int i = 0; i < 60; ++i) {
        all.push_back(std::make_unique<answer<>>());
        tower.async_push("stopped:notice", text, cles::call_options{}.at(via_hub).deadline(1s), all.back()->take());
        answer<int> asked;
        tower.async_pull<int>("hub:speed", cles::call_options{}.urgent(), asked.take());
        run_until(io, [&] { return asked.done(); });
        most = std::max(most, memory(hub, "used"));
    }
    run_until(io, [&] {
        most = std::max(most, memory(hub, "used"));
        return std::all_of(all.begin(), all.end(), [](const auto& a) { return a->done(); });
    });
    BOOST_TEST(most <= budget);
    BOOST_TEST(most >= budget / 3);
    const auto refused = std::count_if(all.begin(), all.end(), [](const auto& a) { return a->code == errc::busy; });
    const auto late = std::count_if(all.begin(), all.end(), [](const auto& a) { return a->code == errc::deadline; });
    // On a slow machine, the hub meanwhile gives up the link on which nothing was accepted for `stall`.
    const auto lost = std::count_if(all.begin(), all.end(), [](const auto& a) { return a->code == errc::unavailable; });
    BOOST_TEST(refused + late + lost == 60);
    BOOST_TEST(refused > 0);
    BOOST_TEST(late > 0);
    run_until(io, [&] { return memory(hub, "used") == 0; });
}

BOOST_AUTO_TEST_CASE(large_requests_of_a_program_to_a_peer_that_reads_none_are_busy) {
    boost::asio::io_context io;
    const stopped_node stopped{io};
    auto options = listening("car1", carrier::tcp4, {.memory = budget});
    options.peers.emplace("stopped", stopped.url());
    cles::service car{io, options};
    std::vector<std::unique_ptr<answer<>>> all;
    for (int i = 0; i < 100; ++i) {
        all.push_back(std::make_unique<answer<>>());
        car.async_push("stopped:notice", std::string(large / 2, 'x'), all.back()->options().deadline(1h),
                       all.back()->take());
    }
    run_until(io, [&] {
        BOOST_REQUIRE(memory(car, "used") <= budget);
        return std::any_of(all.begin(), all.end(), [](const auto& a) { return a->done(); });
    });
    for (const auto& each : all) {
        BOOST_TEST((!each->done() || each->code == errc::busy), each->words);
        BOOST_TEST((!each->done() || each->words.find("limits.memory") != std::string::npos), each->words);
    }
}

BOOST_AUTO_TEST_CASE(last_values_stay_within_it_and_those_of_a_task_replace_each_other) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4, {.memory = budget})};
    for (int i = 0; i < 100; ++i) {
        car.update("map/" + std::to_string(i), std::string(large - 1000, 'x'));
        BOOST_TEST(memory(car, "values") <= budget / 2);
    }
    scripted_peer peer{io, car.endpoints().front()};
    BOOST_TEST(peer.ask("BIND self:map/0") == "{}");
    BOOST_TEST(peer.ask("BIND self:map/99").size() > large - 1000);
    for (int i = 0; i < 100; ++i) {
        static_cast<void>(car.retire("map/" + std::to_string(i)));
    }
    run_until(io, [&] { return memory(car, "values") < 1000; });
    BOOST_TEST(!car.retire("map/99"));
    BOOST_TEST(!car.retire("no such:noun"));
}

BOOST_AUTO_TEST_CASE(one_value_for_many_who_do_not_read_stays_within_it) {
    boost::asio::io_context io;
    cles::service car{io, listening("car1", carrier::tcp4, {.memory = budget})};
    car.on_bind("map");
    std::vector<std::unique_ptr<scripted_peer>> slow;
    for (int i = 0; i < 40; ++i) {
        slow.push_back(std::make_unique<scripted_peer>(io, car.endpoints().front(), buffers::small));
        BOOST_TEST(slow.back()->ask("BIND self:map") == "{}");
    }
    std::uint64_t most = 0;
    for (int i = 0; i < 20; ++i) {
        car.update("map", std::to_string(i) + std::string(large / 5, 'x'));
        run_ready(io);
        most = std::max(most, memory(car, "used"));
    }
    BOOST_TEST(most <= budget);
    for (const auto& each : slow) { // the newest one succeeds
        while (each->line().find("\"19xxx") == std::string::npos) {
        }
    }
    run_until(io, [&] { return memory(car, "used") == memory(car, "values"); });
}

BOOST_AUTO_TEST_SUITE_END()
