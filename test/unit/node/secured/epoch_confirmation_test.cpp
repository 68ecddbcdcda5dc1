// SPDX-License-Identifier: BSL-1.0
#include "node/secured/epoch_confirmation.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>

namespace epoch_confirmation {
namespace {

using cles::core::read_confirmed_epoch;
using cles::test::scripted_security;

const std::string challenge = "abcdefghijklmnopqrst-Q";
const std::string said = R"({"node":"car2","endpoints":[]})";

struct fixture {
    static std::string reply(const std::string& body, const std::string& of = challenge, const std::string& by = "car2",
                             const std::string& path = "cles/announced/") {
        return R"({"announced":)" + body + R"(,"seq":18,"epoch":"0000000b","sig":")" +
               scripted_security::signature(by, path + of, 18, "0000000b", body) + "\"}";
    }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::test::test_link link{node, "car2"};
};

} // namespace
} // namespace epoch_confirmation

BOOST_FIXTURE_TEST_SUITE(epoch_confirmation, fixture)

BOOST_AUTO_TEST_CASE(a_node_confirms_its_epoch) {
    const auto answer = link.ask("PULL car1:cles/announced/" + challenge + " id=7");
    BOOST_REQUIRE_MESSAGE(answer.starts_with("id=7 {\"announced\":{\"node\":\"car1\""), answer);
    const auto json = answer.substr(5, answer.size() - 6);
    BOOST_TEST((read_confirmed_epoch(json, "car1", challenge, *security).value().epoch == 0x5f3a09c1U), json);
    BOOST_TEST(answer.find("\"roster\":7") != std::string::npos, answer);
}

BOOST_AUTO_TEST_CASE(a_node_that_announces_itself_to_nobody_says_what_it_signs) {
    node.host->tasks.add(cles::verb::bind, "control", {.info = {.must_be_signed = true}});
    const auto answer = link.ask("PULL car1:cles/announced/" + challenge + " id=7");
    BOOST_TEST(answer.find(R"("signed":["control"])") != std::string::npos, answer);
}

BOOST_AUTO_TEST_CASE(it_is_exempt_from_rights) {
    security->denied = {"car2 PULL car1:cles/announced/" + challenge};
    BOOST_TEST(link.kind("PULL car1:cles/announced/" + challenge + " id=7") == "id=7 ok");
}

BOOST_AUTO_TEST_CASE(nothing_but_a_challenge_is_signed) {
    for (const std::string text :
         {"x", "abcdefghijklmnopqrstuvwx", "abcdefghijklmnopqrst-R", "abcdefghijklmnopqrs.-Q"}) {
        BOOST_TEST(link.kind("PULL car1:cles/announced/" + text + " id=7") == "id=7 bad_request", text);
    }
    BOOST_TEST(link.kind("PUSH car1:cles/announced/" + challenge + " id=7") == "id=7 bad_request");
    BOOST_TEST(link.kind("PULL car1:cles/announced id=7") == "id=7 no_task");
    BOOST_TEST(link.kind("PULL car1:cles/announced/" + challenge + "/x id=7") == "id=7 no_task");
}

BOOST_AUTO_TEST_CASE(without_security_there_is_no_such_task) {
    cles::test::test_node open;
    cles::test::test_link to{open};
    BOOST_TEST(to.kind("PULL car1:cles/announced/" + challenge + " id=7") == "id=7 no_task");
}

BOOST_AUTO_TEST_CASE(the_question_names_node_and_challenge) {
    BOOST_TEST(cles::core::epoch_question("car2", challenge) == "car2:cles/announced/" + challenge);
}

BOOST_AUTO_TEST_CASE(only_a_reply_that_the_node_has_signed_for_this_challenge_counts) {
    BOOST_TEST((read_confirmed_epoch(reply(said), "car2", challenge, *security).value().epoch == 0xBU));
    const std::string other = "AAAAAAAAAAAAAAAAAAAAAA";
    BOOST_TEST(!read_confirmed_epoch(reply(said, other), "car2", challenge, *security));
    BOOST_TEST(!read_confirmed_epoch(reply(said, challenge, "car3"), "car2", challenge, *security));
    BOOST_TEST(!read_confirmed_epoch(reply(said), "car3", challenge, *security));
    BOOST_TEST(!read_confirmed_epoch(reply(said, "", "car2", "cles"), "car2", challenge, *security)); // an announcement
    BOOST_TEST(!read_confirmed_epoch(reply(R"({"node":"car3"})"), "car2", challenge, *security));
    auto altered = reply(said);
    altered.replace(altered.find("0000000b"), 8, "0000000c");
    BOOST_TEST(!read_confirmed_epoch(altered, "car2", challenge, *security));
    for (const std::string bad : {"", "{}", "[]", "{\"announced\":{}}", R"({"announced":{},"seq":1,"epoch":"x"})"}) {
        BOOST_TEST(!read_confirmed_epoch(bad, "car2", challenge, *security), bad);
    }
}

BOOST_AUTO_TEST_SUITE_END()
