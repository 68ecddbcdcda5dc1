// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/request_reader.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace request_reader {
namespace {

using namespace std::string_literals;
using step = gateway::request_reader::step;

/// Reads on until bytes are missing, a request is complete, or it is refused.
step read(gateway::request_reader& reader, std::string_view bytes) {
    reader.add(bytes);
    const auto next = reader.advance();
    return next == step::head ? reader.advance() : next;
}

/// The status with which this is refused; 0 if it is not.
int status_of(std::string_view bytes) {
    gateway::request_reader reader;
    return read(reader, bytes) == step::refused ? reader.why().status : 0;
}

constexpr std::string_view push =
    "POST /push/car1/target HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    "Content-Length: 11\r\n\r\n{\"speed\":3}";

} // namespace
} // namespace request_reader

BOOST_AUTO_TEST_SUITE(request_reader)

BOOST_AUTO_TEST_CASE(a_request_is_read) {
    gateway::request_reader reader;
    BOOST_TEST((read(reader, push) == step::complete));
    const auto& request = reader.request();
    BOOST_TEST(request.method == "POST");
    BOOST_TEST(request.target == "/push/car1/target");
    BOOST_TEST(request.field("host") == "localhost");
    BOOST_TEST(request.field("content-type") == "application/json");
    BOOST_TEST(request.field("origin") == "");
    BOOST_TEST(request.body == "{\"speed\":3}");
    BOOST_TEST(request.keep_alive);
}

BOOST_AUTO_TEST_CASE(bytes_may_come_one_by_one) {
    gateway::request_reader reader;
    std::vector<step> told;
    for (const char byte : push) {
        BOOST_TEST(told.size() < 2U);
        reader.add({&byte, 1});
        for (auto next = reader.advance(); next != step::incomplete; next = reader.advance()) {
            told.push_back(next);
            if (next == step::complete) {
                break;
            }
        }
    }
    BOOST_TEST((told == std::vector<step>{step::head, step::complete}));
    BOOST_TEST(reader.request().body == "{\"speed\":3}");
}

BOOST_AUTO_TEST_CASE(the_next_request_may_follow) {
    gateway::request_reader reader;
    BOOST_TEST((read(reader, std::string{push} + "GET /metrics HTTP/1.1\r\nHost: a\r\n\r\nGET") == step::complete));
    reader.next();
    BOOST_TEST((read(reader, "") == step::complete));
    BOOST_TEST(reader.request().target == "/metrics");
    BOOST_TEST(reader.request().body == "");
    BOOST_TEST(reader.unread() == 3U);
    reader.next();
    BOOST_TEST((read(reader, "") == step::incomplete));
    BOOST_TEST(reader.has_begun());
}

BOOST_AUTO_TEST_CASE(nothing_has_begun_without_bytes) {
    gateway::request_reader reader;
    BOOST_TEST((reader.advance() == step::incomplete));
    BOOST_TEST(!reader.has_begun());
    BOOST_TEST((read(reader, "G") == step::incomplete));
    BOOST_TEST(reader.has_begun());
}

BOOST_AUTO_TEST_CASE(a_client_may_wait_before_it_sends_the_body) {
    gateway::request_reader reader;
    reader.add("POST /push/a/b HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n");
    BOOST_TEST((reader.advance() == step::head));
    BOOST_TEST(reader.expects_continue());
    BOOST_TEST((read(reader, "{}") == step::complete));
    BOOST_TEST(!reader.expects_continue());
}

BOOST_AUTO_TEST_CASE(the_connection_may_end) {
    for (const auto* const head :
         {"GET / HTTP/1.0\r\nHost: a\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n"}) {
        gateway::request_reader reader;
        BOOST_TEST((read(reader, head) == step::complete));
        BOOST_TEST(!reader.request().keep_alive);
    }
}

// A proxy in front must not find other requests in the same bytes.
BOOST_AUTO_TEST_CASE(an_end_that_could_be_disputed_is_refused) {
    const std::string head = "POST / HTTP/1.1\r\nHost: a\r\n";
    for (const auto& [fields, status] : std::vector<std::pair<std::string, int>>{
             {"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 411},
             {"Transfer-Encoding: chunked\r\nContent-Length: 5\r\n\r\n0\r\n\r\n", 400},
             {"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400},
             {"Content-Length: 0\r\nContent-Length: 5\r\n\r\nhello", 400},
             {"Content-Length: 5\r\nContent-Length: 5\r\n\r\nhello", 400},
             {"Content-Length: 5, 5\r\n\r\nhello", 400},
             {"Content-Length: +5\r\n\r\nhello", 400},
             {"Content-Length: -5\r\n\r\nhello", 400},
             {"Content-Length : 5\r\n\r\nhello", 400},
             {"Content-Length: 99999999999999999999\r\n\r\nhello", 400},
         }) {
        BOOST_TEST(status_of(head + fields) == status, fields);
    }
}

BOOST_AUTO_TEST_CASE(what_is_no_request_is_refused) {
    BOOST_TEST(status_of("PULL car1:speed\r\n\r\n") == 400);
    BOOST_TEST(status_of("GET / HTTP/2.0\r\nHost: a\r\n\r\n") == 505);
    BOOST_TEST(status_of("GET / HTTP/1.1\r\n\r\n") == 400);
    BOOST_TEST(status_of("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n") == 400);
    BOOST_TEST(status_of("GET http://a/ HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
    BOOST_TEST(status_of("OPTIONS * HTTP/1.1\r\nHost: a\r\n\r\n") == 400);
    BOOST_TEST(status_of("GET / HTTP/1.1\r\nHost: a\0b\r\n\r\n"s) == 400);
    gateway::request_reader reader;
    reader.add("GET / HTTP/1.1\nHost: a\n\n");
    BOOST_TEST((reader.advance() != step::head));
}

BOOST_AUTO_TEST_CASE(sizes_are_limited) {
    const std::string get = "GET / HTTP/1.1\r\nHost: a\r\n";
    BOOST_TEST(status_of("GET /" + std::string(20'000, 'a') + " HTTP/1.1\r\nHost: a\r\n\r\n") == 431);
    BOOST_TEST(status_of("GET /" + std::string(20'000, 'a')) == 431);
    BOOST_TEST(status_of(get + "A: " + std::string(20'000, 'a')) == 431);
    std::string fields;
    for (int i = 0; i < 99; ++i) {
        fields += "A: b\r\n";
    }
    BOOST_TEST(status_of(get + fields + "\r\n") == 0);
    BOOST_TEST(status_of(get + fields + "A: b\r\n\r\n") == 431);
    BOOST_TEST(status_of("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1048577\r\n\r\n") == 413);
    const std::string longest(gateway::request_reader::longest_body, ' ');
    gateway::request_reader reader;
    BOOST_TEST(
        (read(reader, "POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1048576\r\n\r\n" + longest) == step::complete));
    BOOST_TEST(reader.request().body.size() == longest.size());
}

BOOST_AUTO_TEST_CASE(after_a_refusal_nothing_is_read) {
    gateway::request_reader reader;
    BOOST_TEST((read(reader, "x\r\n\r\n") == step::refused));
    BOOST_TEST((read(reader, push) == step::refused));
}

BOOST_AUTO_TEST_SUITE_END()
