// SPDX-License-Identifier: BSL-1.0
// A link that the other end refuses: its only line is a `busy` that replies to no request.
#include "node/routing/subrequest.hpp"
#include "node/session/session.hpp"
#include "support/sent_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace refused_link {
namespace {

using cles::errc;
using cles::verb;
using cles::test::send_on;
using namespace std::chrono_literals;

constexpr std::string_view busy = R"({"error":"busy","message":"car2 has reached its limit of links","retry_ms":1000})";

struct fixture {
    fixture() { link.session().expect_refusal(); }

    std::shared_ptr<cles::test::outcome> send(std::uint64_t id) { return send(link, id); }
    std::shared_ptr<cles::test::outcome> send(cles::test::test_link& on, std::uint64_t id) const {
        return send_on(on, node, {.verb = verb::pull, .noun = "car2:speed", .id = id});
    }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace refused_link

BOOST_FIXTURE_TEST_SUITE(refused_link, fixture)

BOOST_AUTO_TEST_CASE(all_its_requests_are_busy_when_it_ends) {
    const auto one = send(1);
    const auto two = send(2);
    link.ask(busy);
    BOOST_TEST(!one->ended);
    link.half_close();
    for (const auto& each : {one, two}) {
        BOOST_TEST((each->code == errc::busy));
        BOOST_TEST(each->text == "car2 has reached its limit of links");
    }
    BOOST_TEST(node.counts().replies_dropped == 1U); // it replied to none of them
}

BOOST_AUTO_TEST_CASE(link_may_also_end_by_a_reset) {
    const auto one = send(1);
    link.ask(busy);
    link.reset();
    BOOST_TEST((one->code == errc::busy));
}

BOOST_AUTO_TEST_CASE(empty_lines_do_not_count) {
    const auto one = send(1);
    link.ask("");
    link.ask(std::string{busy} + "\r");
    link.ask("");
    link.half_close();
    BOOST_TEST((one->code == errc::busy));
}

BOOST_AUTO_TEST_CASE(router_gets_not_started_and_the_retry_time) {
    const auto failed = std::make_shared<std::optional<cles::core::subrequest_failure>>();
    const auto now = node.clock.now();
    link.session().asking().send({.verb = verb::delegate, .noun = "car2:work", .id = 1}, now + 5s, now,
                                 cles::detail::pending_ptr{new cles::core::subrequest(
                                     [failed](std::string_view, cles::core::subrequest_failure* why) {
                                         if (why != nullptr) {
                                             *failed = *why;
                                         }
                                     })});
    link.ask(busy);
    link.half_close();
    BOOST_REQUIRE(failed->has_value());
    BOOST_TEST(!(*failed)->may_have_started);
    BOOST_TEST(((*failed)->reported.code == errc::busy));
    BOOST_TEST((*failed)->reported.retry_ms.value_or(0) == 1000U);
}

BOOST_AUTO_TEST_CASE(after_another_line_it_is_a_normal_link) {
    const auto before = send(1);
    link.ask("id=9 {}");
    link.ask(busy);
    link.half_close();
    BOOST_TEST((before->code == errc::unavailable));

    cles::test::test_link other{node};
    other.session().expect_refusal();
    const auto after = send(other, 1);
    other.ask(busy);
    other.ask("PULL car1:cles id=1");
    other.half_close();
    BOOST_TEST((after->code == errc::unavailable));
}

BOOST_AUTO_TEST_CASE(other_failures_and_those_with_an_id_do_not_refuse_a_link) {
    for (const std::string_view line :
         {R"({"error":"denied","message":"no"})", R"(id=7 {"error":"busy","message":"no","retry_ms":5})",
          R"({"error":"busy","message":"no","ran":true,"retry_ms":5})", R"({"error":"busy")", "[]", "{}"}) {
        cles::test::test_link other{node};
        other.session().expect_refusal();
        const auto result = send(other, 1);
        other.ask(line);
        other.half_close();
        BOOST_TEST((result->code == errc::unavailable), line);
    }
}

BOOST_AUTO_TEST_CASE(accepted_link_cannot_be_refused) {
    cles::test::test_link other{node};
    const auto result = send(other, 1);
    other.ask(busy);
    other.half_close();
    BOOST_TEST((result->code == errc::unavailable));
}

BOOST_AUTO_TEST_SUITE_END()
