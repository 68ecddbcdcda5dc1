// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/message.hpp"

#include <boost/test/unit_test.hpp>

#include <fstream>
#include <map>
#include <string>
#include <string_view>

namespace message {
namespace {

using cles::errc;

/// The codes and statuses in the table of docs/protocol.md, "Errors".
std::map<std::string, std::string> statuses_of_page() {
    std::ifstream page{"docs/protocol.md"};
    std::map<std::string, std::string> found;
    bool is_there = false;
    for (std::string line; std::getline(page, line);) {
        if (line.starts_with("#")) {
            is_there = line == "### Errors";
        } else if (is_there && line.starts_with("| `")) {
            const auto code = line.substr(3, line.find('`', 3) - 3);
            const auto cell = line.rfind("| ", line.size() - 2) + 2;
            found.emplace(code, line.substr(cell, line.find(' ', cell) - cell));
        }
    }
    return found;
}

gateway::http_response failed(boost::system::error_code code, std::string_view failure = {}) {
    return gateway::response_to_failure(code, "why", failure, {});
}

std::string retry_after(errc code, std::string_view failure) {
    gateway::http_request shown;
    shown.fields = message::failed(code, failure).fields;
    return std::string{shown.field("Retry-After")};
}

} // namespace
} // namespace message

BOOST_AUTO_TEST_SUITE(message)

BOOST_AUTO_TEST_CASE(each_code_has_the_status_of_the_page) {
    std::map<std::string, std::string> ours;
    for (const auto& each : gateway::statuses) {
        ours.emplace(cles::wire_name(each.code), std::to_string(each.status));
    }
    BOOST_TEST(ours.size() == 10U);
    BOOST_TEST((ours == statuses_of_page()));
}

BOOST_AUTO_TEST_CASE(a_failure_is_passed_on_as_it_was_replied) {
    const auto made = message::failed(errc::no_task, R"({"error":"no_task","message":"car1 has no PULL 'speed'"})");
    BOOST_TEST(made.status == 404);
    BOOST_TEST(made.body == R"({"error":"no_task","message":"car1 has no PULL 'speed'"})");
    BOOST_TEST(message::failed(errc::deadline).body == R"({"error":"deadline","message":"why"})");
}

BOOST_AUTO_TEST_CASE(failures_of_this_process_have_codes_that_nodes_reply) {
    BOOST_TEST((gateway::told_code(errc::conversion) == errc::bad_request));
    BOOST_TEST((gateway::told_code(errc::invalid_name) == errc::bad_request));
    BOOST_TEST((gateway::told_code(errc::stopped) == errc::unavailable));
    BOOST_TEST((gateway::told_code(errc::busy) == errc::busy));
    BOOST_TEST((gateway::told_code(boost::system::errc::make_error_code(boost::system::errc::connection_refused)) ==
                errc::unavailable));
    BOOST_TEST(message::failed(errc::already_registered).status == 500);
}

BOOST_AUTO_TEST_CASE(what_may_be_repeated_says_when) {
    BOOST_TEST(retry_after(errc::busy, R"({"error":"busy","retry_ms":1500})") == "2");
    BOOST_TEST(retry_after(errc::busy, R"({"error":"busy","retry_ms":20})") == "1");
    BOOST_TEST(retry_after(errc::busy, R"({"error":"busy"})") == "");
    BOOST_TEST(retry_after(errc::busy, R"({"error":"busy","retry_ms":-1})") == "");
    BOOST_TEST(retry_after(errc::busy, R"({"error":"busy","retry_ms":20,"ran":true})") == ""); // it would run twice
    BOOST_TEST(retry_after(errc::unavailable, R"({"error":"unavailable","retry_ms":20})") == "");
}

BOOST_AUTO_TEST_CASE(a_response_as_it_is_sent) {
    const auto text = gateway::to_text({.status = 200, .body = "{}", .fields = {{"Retry-After", "1"}}}, true);
    BOOST_TEST(text.starts_with("HTTP/1.1 200 OK\r\n"));
    BOOST_TEST(text.ends_with("\r\nRetry-After: 1\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"));
    BOOST_TEST(text.find("\r\nCache-Control: no-store\r\n") != std::string::npos);
    BOOST_TEST(text.find("Connection") == std::string::npos);
    const auto head = gateway::to_text({.status = 200, .body = "{}", .fields = {}}, true, false);
    BOOST_TEST(head.ends_with("\r\nContent-Length: 2\r\n\r\n"));
    const auto page = gateway::to_text({.status = 200, .fields = {}, .permanent = "<html>"}, true);
    BOOST_TEST(page.ends_with("\r\nContent-Length: 6\r\n\r\n")); // which follows, and is not copied
    const auto last = gateway::to_text({.status = 204, .body = {}}, false);
    BOOST_TEST(last.starts_with("HTTP/1.1 204 No Content\r\n"));
    BOOST_TEST(last.ends_with("\r\nConnection: close\r\n\r\n"));
    BOOST_TEST(last.find("Content-Length") == std::string::npos);
    BOOST_TEST(
        gateway::event_stream_head({}).ends_with("Content-Type: text/event-stream\r\nX-Accel-Buffering: no\r\n\r\n"));
}

BOOST_AUTO_TEST_CASE(a_refusal_is_a_failure_too) {
    const auto made = gateway::response_of({.status = 401, .message = "who are \"you\"?", .fields = {{"A", "b"}}});
    BOOST_TEST(made.status == 401);
    BOOST_TEST(made.body == R"({"error":"denied","message":"who are \"you\"?"})");
    BOOST_TEST(made.fields.size() == 1U);
}

BOOST_AUTO_TEST_CASE(lists_are_taken_apart) {
    std::string_view list = " a , b,,c";
    BOOST_TEST(gateway::take_part(list, ',') == "a");
    BOOST_TEST(gateway::take_part(list, ',') == "b");
    BOOST_TEST(gateway::take_part(list, ',') == "");
    BOOST_TEST(gateway::take_part(list, ',') == "c");
    BOOST_TEST(list.empty());
    BOOST_TEST(gateway::trimmed(" \t ") == "");
    BOOST_TEST(gateway::small_letters("Ä-aZ") == "Ä-az");
}

BOOST_AUTO_TEST_SUITE_END()
