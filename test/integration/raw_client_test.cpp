// SPDX-License-Identifier: BSL-1.0
// Clients such as netcat, well-behaved or not: what a service sends to a plain socket.

#include <cles/service.hpp>

#include "support/data_test_case.hpp"
#include "support/localization.hpp"
#include "support/node.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(raw_client)

using namespace cles::test;
using namespace std::chrono_literals;

struct node {
    explicit node(carrier kind = carrier::tcp4, const cles::limits& bounds = {})
        : car(io, listening("car1", kind, bounds)) {
        car.on_pull("speed", [] { return 42; });
        car.on_push("echo", [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; });
        car.on_delegate("drive", [this](const cles::request&, cles::responder r) { jobs.push_back(std::move(r)); });
    }
    scripted_peer peer() { return {io, car.endpoints().front()}; }
    // Whether the service still serves others.
    bool serves() {
        auto other = peer();
        return other.ask("PULL car1:speed") == R"({"value":42})";
    }

    boost::asio::io_context io;
    std::vector<cles::responder> jobs;
    cles::service car;
};

bool is_failure(const std::string& reply, const std::string& code) {
    return reply.find("{\"error\":\"" + code + "\",\"message\":\"") != std::string::npos;
}

CLES_DATA_TEST_CASE(a_line_gets_a_line, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    BOOST_TEST(peer.ask("PULL car1:speed") == R"({"value":42})");
    BOOST_TEST(peer.ask("pull  self:speed\r") == R"({"value":42})");
    BOOST_TEST(peer.ask("  PULL self:speed id=7  ") == R"(id=7 {"value":42})");
    BOOST_TEST(peer.ask(R"(PUSH self:echo id=8 { "a" : 1 })") == R"(id=8 {"a":1})");
    BOOST_TEST(is_failure(peer.ask("PULL car2:speed id=9"), "no_target"));
    BOOST_TEST(is_failure(peer.ask("PULL car1:altitude"), "no_task"));
    BOOST_TEST(is_failure(peer.ask("FETCH car1:altitude"), "bad_request"));
    peer.send("PUSH self:echo reply=no {}\n\n\r\n");
    BOOST_TEST(peer.ask("PULL self:cles").starts_with(R"({"node":"car1",)"));
}

CLES_DATA_TEST_CASE(requests_without_id_are_answered_in_order_and_those_with_id_when_ready, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("DELEGATE self:drive\nPULL self:speed\nDELEGATE self:drive id=3\nPULL self:speed id=4\n");
    BOOST_TEST(peer.line() == R"(id=4 {"value":42})");
    run_until(n.io, [&] { return n.jobs.size() == 2; });
    n.jobs.at(1).done(cles::json_text{R"({"job":2})"});
    BOOST_TEST(peer.line() == R"(id=3 {"job":2})");
    n.jobs.at(0).done(cles::json_text{R"({"job":1})"});
    BOOST_TEST(peer.line() == R"({"job":1})");
    BOOST_TEST(peer.line() == R"({"value":42})");
}

CLES_DATA_TEST_CASE(bytes_one_at_a_time_are_a_request_too, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    for (const char byte : std::string{"PUSH self:echo id=1 {\"x\":\"\xC3\xA4\"}\r\n"}) {
        peer.send(std::string(1, byte));
        while (n.io.poll_one() != 0) {
        }
    }
    BOOST_TEST(peer.line() == "id=1 {\"x\":\"\xC3\xA4\"}");
}

CLES_DATA_TEST_CASE(after_a_half_close_all_is_answered_and_then_the_link_ends, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("PULL self:speed\nDELEGATE self:drive\nPULL self:speed\n");
    peer.shut();
    BOOST_TEST(peer.line() == R"({"value":42})");
    run_until(n.io, [&] { return n.jobs.size() == 1; });
    BOOST_TEST(!n.jobs.front().stopped());
    n.jobs.front().done();
    BOOST_TEST(peer.rest() == "{}\n{\"value\":42}\n");
    BOOST_TEST(!peer.was_reset());
}

CLES_DATA_TEST_CASE(a_half_close_withdraws_requests_with_an_id, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("DELEGATE self:drive id=5\n");
    run_until(n.io, [&] { return n.jobs.size() == 1; });
    peer.shut();
    run_until(n.io, [&] { return n.jobs.front().stopped(); });
    n.jobs.front().done();
    const auto said = peer.rest();
    BOOST_TEST((said.empty() || is_failure(said, "cancelled")), said);
}

CLES_DATA_TEST_CASE(a_reset_withdraws_everything, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    BOOST_TEST(!peer.ask("PULL self:speed").empty());
    peer.send("DELEGATE self:drive\nDELEGATE self:drive id=1\nPULL self:cles\n");
    run_until(n.io, [&] { return n.jobs.size() == 2; });
    n.jobs[1].progress(0.5); // so that something is unread, which a Unix socket needs for a reset
    peer.reset();
    run_until(n.io, [&] { return n.jobs[0].stopped() && n.jobs[1].stopped(); });
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(a_binding_remains_after_a_half_close_until_a_write_fails, every_socket, kind) {
    node n{kind};
    n.car.update("place", 1);
    auto peer = n.peer();
    BOOST_TEST(peer.ask("BIND self:place") == R"({"value":1})");
    peer.shut();
    run_ready(n.io);
    n.car.update("place", 2);
    const auto update = peer.line();
    BOOST_TEST(update.starts_with("UPDATE car1:place seq=2 epoch="), update);
    BOOST_TEST(update.ends_with(R"( {"value":2})"), update);
    BOOST_TEST(!peer.ended());
}

// -- malformed lines in sequence: each gets its error, and the link stays open -------------------------------------

CLES_DATA_TEST_CASE(malformed_lines_are_reported_and_affect_nothing_else, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    const std::string deep = std::string(33, '[') + std::string(33, ']');
    const std::vector<std::string> lines{
        "hello",
        "PULL",
        "PULL speed",
        "PULL car1:",
        "PULL car1:speed/",
        "PULL car1:speed//x",
        "PULL car1:speed/%0A",
        "PULL car1:speed/%zz",
        "PULL car1:" + std::string(65, 'x'),
        "PULL car1:speed id=0",
        "PULL car1:speed id=01",
        "PULL car1:speed id=9223372036854775808",
        "PULL car1:speed id=1 id=2",
        "PULL car1:speed deadline=0",
        "PULL car1:speed deadline=99999999999999999999",
        "PULL car1:speed must_dance=yes",
        "PULL car1:speed {}",
        "PUSH car1:echo {",
        "PUSH car1:echo {\"a\":01}",
        "PUSH car1:echo {\"a\":\"\xff\"}",
        "PUSH car1:echo {\"a\":\"\xC0\xAF\"}",
        "PUSH car1:echo {\"a\":\"\xED\xA0\x80\"}",
        "PUSH car1:\xff {}",
        "PUSH car1:echo " + deep,
        "PUSH car1:echo {} {}",
        "PUSH car1:echo 7",
        std::string{"PULL car1:speed\0", 16},
        "\tPULL car1:speed",
    };
    for (const auto& line : lines) {
        const auto reply = peer.ask(line);
        BOOST_TEST(is_failure(reply, "bad_request"), line << " -> " << reply);
    }
    BOOST_TEST(peer.ask("PULL car1:speed") == R"({"value":42})");
    BOOST_TEST(peer.ask("PUSH car1:echo " + deep.substr(1, 64)) == deep.substr(1, 64));
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(a_number_that_does_not_fit_is_reported_with_its_position, every_socket, kind) {
    node n{kind};
    n.car.on_push("small", [](std::uint8_t value) { return value; });
    n.car.on_push("whole", [](std::int64_t value) { return value; });
    n.car.on_push("real", [](double value) { return value; });
    n.car.on_push("many", [](const std::vector<localization>& places) { return places.size(); });
    auto peer = n.peer();
    BOOST_TEST(peer.ask(R"(PUSH self:small {"value":255})") == R"({"value":255})");
    BOOST_TEST(peer.ask(R"(PUSH self:whole {"value":-9223372036854775808})") == R"({"value":-9223372036854775808})");
    for (const auto* line :
         {R"(PUSH self:small {"value":256})", R"(PUSH self:small {"value":-1})", R"(PUSH self:small {"value":1.5})",
          R"(PUSH self:whole {"value":9223372036854775808})", R"(PUSH self:real {"value":1e999})",
          R"(PUSH self:real {"value":"x"})", R"(PUSH self:real {})", R"(PUSH self:real [1])"}) {
        const auto reply = peer.ask(line);
        BOOST_TEST(is_failure(reply, "bad_request"), line << " -> " << reply);
        BOOST_TEST(reply.find("the body is invalid: ") != std::string::npos, reply);
    }
    const auto nested = peer.ask(R"(PUSH self:many [{"utc":1,"lat":2,"lon":3},{"utc":1,"lat":true,"lon":3}])");
    BOOST_TEST(nested.find("[1].lat: expected a number") != std::string::npos, nested);
    const auto parameter = peer.ask("PULL self:speed/99999999999999999999");
    BOOST_TEST(parameter == R"({"value":42})"); // its handler does not read it
}

CLES_DATA_TEST_CASE(a_malformed_line_is_answered_with_its_id, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    BOOST_TEST(peer.ask("PUSH car1:echo id=12 {\"a\":}").starts_with("id=12 {\"error\":\"bad_request\""));
    peer.send("DELEGATE self:drive\n");
    peer.send("nonsense\n"); // without id: waits for its turn
    BOOST_TEST(peer.ask("nonsense id=13").starts_with("id=13 {\"error\":\"bad_request\""));
    run_until(n.io, [&] { return n.jobs.size() == 1; });
    n.jobs.front().done();
    BOOST_TEST(peer.line() == "{}");
    BOOST_TEST(is_failure(peer.line(), "bad_request"));
}

CLES_DATA_TEST_CASE(replies_to_nothing_are_never_answered, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("{\"a\":1}\n[1]\nid=77 {}\nid=0 {}\nid=x\n{broken\nUPDATE car9:place seq=1 epoch=00000000 {}\n");
    BOOST_TEST(peer.ask("PULL car1:speed") == R"({"value":42})");
}

CLES_DATA_TEST_CASE(an_id_that_is_in_flight_closes_the_link, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("DELEGATE self:drive id=1\nDELEGATE self:drive id=1\nPULL self:speed\n");
    const auto said = peer.rest();
    BOOST_TEST(is_failure(said, "bad_request"), said);
    BOOST_TEST(said.find("42") == std::string::npos);
    BOOST_TEST(n.jobs.at(0).stopped());
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(a_line_over_the_limit_is_too_large_and_ends_the_link, every_socket, kind) {
    node n{kind, {.line = 2000, .discard = 100ms}};
    auto peer = n.peer();
    peer.send("PULL car1:speed\nPUSH car1:echo id=4 {\"a\":\"" + std::string(2000, 'x') + "\"}\nPULL car1:speed\n");
    BOOST_TEST(peer.line() == R"({"value":42})");
    const auto reply = peer.line();
    BOOST_TEST(reply.starts_with("id=4 {\"error\":\"too_large\""), reply);
    BOOST_TEST(peer.rest().empty());
    BOOST_TEST(!peer.was_reset());
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(an_endless_line_is_too_large_and_is_not_kept, every_socket, kind) {
    node n{kind, {.line = 2000, .discard = 100ms}};
    auto peer = n.peer();
    const std::string piece(10000, 'x');
    std::size_t sent = 0;
    run_until(n.io, [&] {
        try {
            sent += peer.send_some(piece);
        } catch (const std::system_error&) {
            return true; // it has been closed
        }
        return peer.ended();
    });
    BOOST_TEST(is_failure(peer.unread(), "too_large"), peer.unread());
    BOOST_TEST(sent >= 2000U);
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(a_web_page_that_posts_is_turned_away_unanswered, every_socket, kind) {
    node n{kind};
    for (const auto* text :
         {"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nPUSH self:echo {}\r\n", "GET /x HTTP/1.0\r\n\r\nPULL self:speed\n",
          "PULL self:x\nhOsT: 127.0.0.1\nPULL self:speed\n"}) {
        auto peer = n.peer();
        peer.send(text);
        const auto said = peer.rest();
        BOOST_TEST(said.find("42") == std::string::npos, said);
        BOOST_TEST((said.empty() || is_failure(said, "no_task")), said);
    }
    BOOST_TEST(n.serves());
}

CLES_DATA_TEST_CASE(a_reply_over_the_limit_reports_that_the_handler_ran, every_socket, kind) {
    node n{kind, {.line = 1000}};
    n.car.on_pull("much", [] { return std::string(1000, 'x'); });
    auto peer = n.peer();
    const auto reply = peer.ask("PULL self:much id=1");
    BOOST_TEST(is_failure(reply, "too_large"), reply);
    BOOST_TEST(reply.find("\"ran\":true") != std::string::npos, reply);
    BOOST_TEST(peer.ask("PULL self:speed") == R"({"value":42})");
}

CLES_DATA_TEST_CASE(cancel_withdraws_by_id, every_socket, kind) {
    node n{kind};
    auto peer = n.peer();
    peer.send("DELEGATE self:drive id=21 progress=yes\n");
    run_until(n.io, [&] { return n.jobs.size() == 1; });
    n.jobs.front().progress(0.5);
    BOOST_TEST(peer.line() == "id=21 progress=0.5 {}");
    peer.send("PUSH self:cles/cancel/21\n");
    BOOST_TEST(peer.line().starts_with("id=21 {\"error\":\"cancelled\""));
    BOOST_TEST(peer.line() == "{}");
    BOOST_TEST(n.jobs.front().stopped());
    BOOST_TEST(peer.ask("PUSH self:cles/cancel/21") == "{}");
    BOOST_TEST(is_failure(peer.ask("PUSH self:cles/cancel/x"), "bad_request"));
}

BOOST_AUTO_TEST_SUITE_END()
