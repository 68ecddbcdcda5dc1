// SPDX-License-Identifier: BSL-1.0
#include "node/secured/roster_exchange.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>

namespace roster_exchange {
namespace {

struct fixture {
    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
    std::string logged;
    cles::test::test_node node{
        {}, {}, [this](cles::log_level, const cles::log_entry& what) { logged += what.text; }, {}, security};
    cles::test::test_link link{node, "car2"};
};

const std::string good = "{\"good\":1}";

} // namespace
} // namespace roster_exchange

BOOST_FIXTURE_TEST_SUITE(roster_exchange, fixture)

BOOST_AUTO_TEST_CASE(a_member_gets_the_line_as_it_was_signed) {
    BOOST_TEST(link.ask("PULL self:cles/roster id=7") == "id=7 {\"signature\":\"s\",\"roster\":{}}\n");
    BOOST_TEST(link.kind("BIND self:cles/roster id=8") == "id=8 no_task");
}

BOOST_AUTO_TEST_CASE(a_pushed_roster_is_checked) {
    BOOST_TEST(link.kind("PUSH self:cles/roster id=7 " + good) == "id=7 ok");
    BOOST_TEST(security->line == good);
    BOOST_TEST(link.kind("PUSH self:cles/roster id=8 {\"other\":1}") == "id=8 bad_request");
    BOOST_TEST(security->line == good);
}

BOOST_AUTO_TEST_CASE(a_newer_version_is_asked_for) {
    BOOST_TEST(link.ask("PUSH self:cles/hello reply=no {\"version\":7,\"epoch\":\"00000001\"}").empty());
    const auto asked = link.ask("PUSH self:cles/hello reply=no {\"version\":8,\"epoch\":\"00000001\"}");
    BOOST_TEST(asked.starts_with("PULL self:cles/roster id=1"), asked);
    link.ask("id=1 " + good);
    BOOST_TEST(security->line == good);
}

BOOST_AUTO_TEST_CASE(a_bad_one_is_logged) {
    link.ask("PUSH self:cles/hello reply=no {\"version\":8}");
    link.ask("id=1 {\"other\":1}");
    BOOST_TEST(logged.find("car2") != std::string::npos, logged);
    BOOST_TEST(logged.find("a bad roster") != std::string::npos, logged);
    BOOST_TEST(security->line != good);
}

BOOST_AUTO_TEST_CASE(statements_without_meaning_are_ignored) {
    for (const std::string body : {"", "{}", "[]", "{\"version\":-1}", "{\"version\":4294967296}",
                                   "{\"version\":\"8\"}", "{\"version\":8.5}", "{\"version\":8"}) {
        BOOST_TEST(link.ask("PUSH self:cles/hello reply=no " + body).empty(), body);
    }
    cles::test::test_link nobody{node, ""};
    BOOST_TEST(nobody.ask("PUSH self:cles/hello reply=no {\"version\":8}").empty());
}

BOOST_AUTO_TEST_CASE(own_version_is_stated_with_the_epoch) {
    link.session().send_hello();
    BOOST_TEST(link.take() == "PUSH self:cles/hello reply=no {\"version\":7,\"epoch\":\"5f3a09c1\"}\n");
}

BOOST_AUTO_TEST_CASE(without_security_there_are_no_such_tasks) {
    cles::test::test_node open;
    cles::test::test_link to{open};
    BOOST_TEST(to.kind("PULL self:cles/roster id=7") == "id=7 no_task");
    BOOST_TEST(to.ask("PUSH self:cles/hello reply=no {\"version\":8}").empty());
}

BOOST_AUTO_TEST_SUITE_END()
