// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/admission.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace admission {
namespace {

using namespace std::chrono_literals;

/// Instead of SHA-256: "a" has the hash "aaa...".
std::string hash_of(std::string_view token) { return std::string(64, token.front()); }

std::string line(const std::string& name, char digit) { return name + " " + std::string(64, digit) + "\n"; }

gateway::credentials credentials_with(std::string name, std::string value) {
    gateway::http_request request;
    request.fields.emplace_back(std::move(name), std::move(value));
    return gateway::credentials_in(request);
}

/// operator has the token "a", viewer "b".
struct fixture {
    gateway::admission door{true, hash_of};
    gateway::time_point now{};

    fixture() { set_tokens(line("operator", 'a') + line("viewer", 'b')); }
    void set_tokens(const std::string& text) { door.set_tokens(gateway::token_table::read(text)); }

    /// The name of the caller, or the status with which it is refused.
    [[nodiscard]] std::string admit(const gateway::credentials& shown) const {
        const auto made = door.admit(shown, now);
        const auto* const who = std::get_if<gateway::caller>(&made);
        return who != nullptr ? who->name : std::to_string(std::get<gateway::refusal>(made).status);
    }
    [[nodiscard]] gateway::caller caller(const gateway::credentials& shown) const {
        return std::get<gateway::caller>(door.admit(shown, now));
    }
    void open(const std::string& token, const std::string& session) {
        door.open_session(caller({.token = token, .session = {}}), session, now);
    }
};

} // namespace
} // namespace admission

BOOST_AUTO_TEST_SUITE(admission)

BOOST_AUTO_TEST_CASE(a_token_comes_in_one_of_three_ways) {
    BOOST_TEST(credentials_with("authorization", "Bearer abc").token == "abc");
    BOOST_TEST(credentials_with("authorization", "bearer  abc ").token == "abc");
    BOOST_TEST(credentials_with("authorization", "Basic abc").token == "");
    BOOST_TEST(credentials_with("authorization", "Bearer").token == "");
    BOOST_TEST(credentials_with("sec-websocket-protocol", "foxglove.sdk.v1, cles.token.abc").token == "abc");
    BOOST_TEST(credentials_with("sec-websocket-protocol", "foxglove.sdk.v1").token == "");
    BOOST_TEST(credentials_with("cookie", "a=b; cles_session=abc; c=d").session == "abc");
    BOOST_TEST(credentials_with("cookie", "xcles_session=abc").session == "");
    BOOST_TEST(credentials_with("x-token", "abc").token == "");
}

BOOST_AUTO_TEST_CASE(a_cookie_is_for_the_gateway_alone) {
    BOOST_TEST(gateway::cookie_for("abc", true) == "cles_session=abc; Path=/; HttpOnly; SameSite=Strict; Secure");
    BOOST_TEST(gateway::cookie_for("abc", false) == "cles_session=abc; Path=/; HttpOnly; SameSite=Strict");
    BOOST_TEST(gateway::cookie_for("", false) == "cles_session=; Path=/; HttpOnly; SameSite=Strict; Max-Age=0");
}

BOOST_FIXTURE_TEST_CASE(who_has_a_token_is_admitted, fixture) {
    BOOST_TEST(admit({.token = "a", .session = {}}) == "operator");
    BOOST_TEST(admit({.token = "b", .session = {}}) == "viewer");
    BOOST_TEST(admit({.token = "c", .session = {}}) == "401");
    BOOST_TEST(admit({}) == "401");
}

BOOST_AUTO_TEST_CASE(without_tokens_all_are_admitted) {
    const gateway::admission door{false, hash_of};
    const auto made = door.admit({}, {});
    BOOST_TEST(std::get<gateway::caller>(made).name == "");
    BOOST_TEST(door.is_admitted(std::get<gateway::caller>(made), {}));
}

BOOST_FIXTURE_TEST_CASE(a_session_stands_for_a_token, fixture) {
    open("a", "s1");
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "operator");
    BOOST_TEST(admit({.token = {}, .session = "s2"}) == "401");
    BOOST_TEST(admit({.token = "b", .session = "s1"}) == "viewer"); // the token counts
    BOOST_TEST(admit({.token = "c", .session = "s1"}) == "401");
    door.close_session(caller({.token = {}, .session = "s1"}), "s1");
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "401");
}

BOOST_FIXTURE_TEST_CASE(a_token_ends_its_own_sessions, fixture) {
    open("a", "s1");
    door.close_session(caller({.token = "b", .session = {}}), "s1");
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "operator");
    door.close_session(caller({.token = "a", .session = "s1"}), "s1");
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "401");
    door.close_session(caller({.token = "a", .session = {}}), "");
}

BOOST_FIXTURE_TEST_CASE(a_session_ends, fixture) {
    open("a", "s1");
    const auto who = caller({.token = {}, .session = "s1"});
    now += gateway::admission::longest_session - 1s;
    BOOST_TEST(door.is_admitted(who, now));
    now += 1s;
    BOOST_TEST(!door.is_admitted(who, now));
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "401");
    BOOST_TEST(admit({.token = "a", .session = {}}) == "operator");
}

// It is asked again before each update.
BOOST_FIXTURE_TEST_CASE(a_token_may_be_withdrawn, fixture) {
    open("a", "s1");
    const auto by_token = caller({.token = "a", .session = {}});
    const auto by_session = caller({.token = {}, .session = "s1"});
    BOOST_TEST((door.is_admitted(by_token, now) && door.is_admitted(by_session, now)));
    set_tokens(line("viewer", 'b'));
    BOOST_TEST((!door.is_admitted(by_token, now) && !door.is_admitted(by_session, now)));
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "401");
    set_tokens(line("somebody", 'a')); // it is another member's now
    BOOST_TEST((!door.is_admitted(by_token, now) && !door.is_admitted(by_session, now)));
}

BOOST_FIXTURE_TEST_CASE(the_sessions_of_a_token_are_limited, fixture) {
    open("b", "other");
    for (std::size_t i = 0; i <= gateway::admission::most_sessions; ++i) {
        now += 1s;
        open("a", "s" + std::to_string(i));
    }
    BOOST_TEST(admit({.token = {}, .session = "s0"}) == "401");
    BOOST_TEST(admit({.token = {}, .session = "s1"}) == "operator");
    BOOST_TEST(admit({.token = {}, .session = "other"}) == "viewer");
}

BOOST_AUTO_TEST_SUITE_END()
