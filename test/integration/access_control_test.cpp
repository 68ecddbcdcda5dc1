// SPDX-License-Identifier: BSL-1.0
// Which peers are admitted, where a service may listen, and which names are valid.

#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

#include <unistd.h>

BOOST_AUTO_TEST_SUITE(access_control)

using namespace cles::test;
using cles::errc;

constexpr std::array carriers{carrier::tcp4, carrier::tcp6, carrier::unix_file, carrier::unix_abstract,
                              carrier::inproc};

struct refusal {
    boost::system::error_code code{};
    std::string words{};
};

refusal refusal_of(const cles::service_options& options) {
    boost::asio::io_context io;
    try {
        cles::service attempt{io, options};
    } catch (const cles::error& e) {
        return {e.code(), e.message()};
    }
    return {};
}

CLES_DATA_TEST_CASE(an_authoriser_that_denies_all_lets_nothing_through, carriers, kind) {
    boost::asio::io_context io;
    auto options = listening("car1", kind);
    std::vector<std::string> asked;
    std::string transport;
    options.authorise = [&](const cles::access& a) {
        asked.push_back(std::string{cles::to_string(a.verb)} + " " + std::string{a.path});
        transport = a.peer.transport;
        return false;
    };
    cles::service car{io, options};
    int ran = 0;
    const auto run = [&] { ++ran; };
    car.on_pull("a", run);
    car.on_push("a", run);
    car.on_delegate("a", run);
    car.on_update("a", run);
    car.update("a", 1);
    cles::service tower{io, knowing("tower", car)};
    const std::vector<std::string> commands{
        "PULL car1:a",    "PUSH car1:a {}",         "DELEGATE car1:a {}",         "UPDATE car1:a {}",
        "PULL car1:cles", "PULL car1:cles/metrics", "PUSH car1:cles/cancel/1 {}", "PULL car1:nothing/x"};
    for (const auto& command : commands) {
        answer<> a;
        tower.async_request(command, a.options(), a.take());
        run_until(io, [&] { return a.done(); });
        BOOST_TEST(a.code == errc::denied, command << ": " << a.code.message());
        BOOST_TEST(a.words.find("car1") != std::string::npos, a.words);
    }
    feed_log feed;
    feed.bind(tower, "car1:a");
    run_until(io, [&] { return feed.binds == 1; });
    BOOST_TEST(feed.code == errc::denied);
    BOOST_TEST(ran == 0);
    BOOST_TEST(asked.size() == commands.size() + 1);
    BOOST_TEST(asked.front() == "PULL a");
    BOOST_TEST(asked.back() == "BIND a");
    BOOST_TEST(transport == cles::parse_url(car.endpoints().front()).scheme);
}

BOOST_AUTO_TEST_CASE(the_in_process_way_is_no_way_round_the_authoriser) {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car1", .authorise = [](const cles::access&) { return false; }}};
    car.on_pull("a", [] {});
    cles::service tower{io, {.name = "tower"}};
    answer<> self;
    answer<> other;
    car.async_pull("self:a", self.take());
    tower.async_pull("car1:a", other.take());
    run_until(io, [&] { return self.done() && other.done(); });
    BOOST_TEST(self.code == errc::denied);
    BOOST_TEST(other.code == errc::denied);
}

BOOST_AUTO_TEST_CASE(an_authoriser_sees_who_asks_for_what) {
    boost::asio::io_context io;
    auto options = listening("car1", carrier::unix_file);
    cles::identity seen;
    options.authorise = [&](const cles::access& a) {
        seen = a.peer;
        return a.verb == cles::verb::pull && a.task == "speed" && a.path == "speed/a";
    };
    cles::service car{io, options};
    car.on_pull("speed", [] { return 42; });
    scripted_peer peer{io, car.endpoints().front()};
    BOOST_TEST(peer.ask("PULL self:speed/%61") == R"({"value":42})");
    BOOST_TEST(peer.ask("PULL self:speed/b").starts_with(R"({"error":"denied")"));
    BOOST_TEST(peer.ask("PULL self:cles").starts_with(R"({"error":"denied")"));
    BOOST_TEST(seen.transport == "unix");
    BOOST_TEST(seen.uid.value_or(~0U) == ::getuid());
    BOOST_TEST(seen.local);
}

BOOST_AUTO_TEST_CASE(listening_beyond_this_host_needs_insecure) {
    for (const auto* where : {"tcp://0.0.0.0:0", "tcp://[::]:0", "tcp://192.0.2.1:0"}) {
        const auto refused = refusal_of({.name = "car1", .listen = {where}});
        BOOST_TEST(refused.code == errc::insecure_listen, where << ": " << refused.code.message());
        BOOST_TEST(refused.words.find(where) != std::string::npos, refused.words);
    }
    BOOST_TEST(!refusal_of({.name = "car1", .listen = {"tcp://0.0.0.0:0"}, .insecure = true}).code);
    boost::asio::io_context io;
    cles::service car{io, {.name = "car1"}};
    BOOST_CHECK_EXCEPTION(car.listen("tcp://0.0.0.0:0"), cles::error,
                          [](const cles::error& e) { return e.code() == errc::insecure_listen; });
    BOOST_TEST(car.endpoints().empty());
}

CLES_DATA_TEST_CASE(an_address_that_is_taken_is_the_systems_error_and_is_named, carriers, kind) {
    boost::asio::io_context io;
    cles::service first{io, listening("car1", kind)};
    const auto where = first.endpoints().front();
    try {
        cles::service second{io, {.name = "car2", .listen = {where}}};
        BOOST_ERROR("listens twice");
    } catch (const cles::error& e) {
        BOOST_TEST(e.code() == boost::asio::error::address_in_use);
        BOOST_TEST(e.message().find(where) != std::string::npos, e.message());
        BOOST_TEST(std::string{e.what()}.find("/usr/") == std::string::npos, e.what());
    }
    cles::service tower{io, knowing("tower", first)};
    answer<> a;
    tower.async_pull("car1:cles", a.take());
    run_until(io, [&] { return a.done(); });
    BOOST_TEST(!a.code);
}

BOOST_AUTO_TEST_CASE(an_interface_that_is_not_there_is_the_systems_error_and_is_named) {
    const auto refused = refusal_of({.name = "car1", .listen = {"tcp://192.0.2.1:0"}, .insecure = true});
    BOOST_TEST(refused.code == boost::system::errc::address_not_available);
    BOOST_TEST(refused.words.find("tcp://192.0.2.1:0") != std::string::npos, refused.words);
}

BOOST_AUTO_TEST_CASE(what_was_opened_before_a_listener_failed_is_closed_again) {
    boost::asio::io_context io;
    const auto name = fresh_address(carrier::unix_abstract);
    for (int i = 0; i < 2; ++i) {
        BOOST_CHECK_THROW((cles::service{io, {.name = "car1", .listen = {name, "unix:///no/such/folder/socket"}}}),
                          cles::error);
    }
    const cles::service works{io, {.name = "car1", .listen = {name}}};
    BOOST_TEST(works.endpoints().size() == 1U);
}

BOOST_AUTO_TEST_CASE(invalid_node_names_are_refused) {
    for (const std::string& name : {std::string{}, std::string{"self"}, std::string{"any"}, std::string{"all"},
                                    std::string{"car 1"}, std::string{"car/1"}, std::string{"c\xC3\xA4r"},
                                    std::string(65, 'x'), std::string{"car:1"}, std::string{"car\n"}}) {
        const auto refused = refusal_of({.name = name});
        BOOST_TEST(refused.code == errc::invalid_name, name);
        BOOST_TEST(!refused.words.empty());
        BOOST_TEST((refusal_of({.name = "car1", .peers = {{name, "tcp://127.0.0.1"}}}).code == errc::invalid_name),
                   name);
    }
    BOOST_TEST(!refusal_of({.name = std::string(64, 'x')}).code);
}

BOOST_AUTO_TEST_CASE(addresses_that_are_none_are_refused) {
    for (const auto* where :
         {"", "127.0.0.1:80", "tcp://", "tcp://:80", "tcp://127.0.0.1:65536", "tcp://127.0.0.1:x", "tcp://127.0.0.1/x",
          "tcp://::1", "tcp://[::1", "unix://relative", "unix://", "unix:///", "inproc://", "://x"}) {
        BOOST_TEST(refusal_of({.name = "car1", .listen = {where}}).code.failed(), where);
        if (std::string{where} != "" && std::string{where} != "unix:///") { // removes the peer; is a folder
            const auto refused = refusal_of({.name = "car1", .peers = {{"car2", where}}});
            BOOST_TEST(refused.code == errc::invalid_url, where);
            BOOST_TEST(refused.words.find(where) != std::string::npos, refused.words);
        }
    }
    BOOST_TEST(refusal_of({.name = "car1", .listen = {"smoke://signals"}}).code == errc::unknown_scheme);
    BOOST_TEST((refusal_of({.name = "car1", .peers = {{"car2", "smoke://signals"}}}).code == errc::unknown_scheme));
}

BOOST_AUTO_TEST_CASE(tasks_that_cannot_be_are_refused) {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car1"}};
    const auto run = [] {};
    const auto fails_with = [](errc code) { return [code](const cles::error& e) { return e.code() == code; }; };
    for (const std::string& task : {std::string{}, std::string{"a b"}, std::string{"a/b"}, std::string{"cles"}}) {
        BOOST_CHECK_EXCEPTION(car.on_pull(task, run), cles::error, fails_with(errc::invalid_name));
        BOOST_CHECK_EXCEPTION(car.update(task + " ", 1), cles::error, fails_with(errc::invalid_name));
    }
    BOOST_CHECK_EXCEPTION(car.update("cles", 1), cles::error, fails_with(errc::invalid_name));
    car.on_pull("a", run);
    car.on_push("a", run);
    BOOST_CHECK_EXCEPTION(car.on_pull("a", run), cles::error, fails_with(errc::already_registered));
    BOOST_CHECK_EXCEPTION(car.update("a", cles::json_text{R"({"error":1})"}), cles::error, fails_with(errc::failed));
    BOOST_CHECK_EXCEPTION(car.update("a", std::string(2U << 20U, 'x')), cles::error, fails_with(errc::too_large));
}

BOOST_AUTO_TEST_CASE(listening_at_several_addresses_serves_them_all) {
    boost::asio::io_context io;
    cles::service car{io, {.name = "car1"}};
    car.on_pull("speed", [] { return 42; });
    for (const auto kind : every_socket) {
        const auto where = car.listen(fresh_address(kind));
        scripted_peer peer{io, where};
        BOOST_TEST(peer.ask("PULL car1:speed") == R"({"value":42})");
    }
    BOOST_TEST(car.endpoints().size() == every_socket.size());
    const auto info = car.request("PULL self:cles");
    for (const auto& where : car.endpoints()) {
        BOOST_TEST(info.find("\"" + where + "\"") != std::string::npos, info);
    }
}

BOOST_AUTO_TEST_SUITE_END()
