// SPDX-License-Identifier: BSL-1.0
#include "node/session/request_checks.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace request_checks {
namespace {

cles::protocol::noun_view parse(std::string_view text) {
    cles::protocol::noun_view noun;
    std::string why;
    BOOST_REQUIRE(cles::protocol::parse_noun(text, noun, why));
    return noun;
}

std::optional<std::uint64_t> cancelled(std::string_view noun) { return cles::core::cancelled_id(parse(noun)); }

} // namespace
} // namespace request_checks

BOOST_AUTO_TEST_SUITE(request_checks)

BOOST_AUTO_TEST_CASE(all_decoded_parameters_stay_valid) {
    std::string storage;
    std::string noun = "car1:log";
    for (int i = 0; i < 32; ++i) {
        noun += i % 2 == 0 ? "/plain" : "/%C3%A4%20" + std::string(50, 'x');
    }
    const auto all = cles::core::decode(parse(noun), storage);
    BOOST_REQUIRE_EQUAL(all.size(), 32U);
    for (std::size_t i = 0; i < all.size(); ++i) {
        BOOST_TEST(all[i] == (i % 2 == 0 ? "plain" : "\xC3\xA4 " + std::string(50, 'x')));
    }
}

BOOST_AUTO_TEST_CASE(a_body_whose_first_key_is_error_is_recognised) {
    for (const std::string_view bad :
         {"{\"error\":1}", "{ \"error\" : null }", "{\"\\u0065rror\":[]}", "{\"error\":\"busy\",\"a\":1}"}) {
        BOOST_TEST(cles::protocol::begins_with_error(bad), bad);
    }
    for (const std::string_view good : {"", "{}", "[]", "[\"error\"]", "{\"errors\":1}", "{\"a\":1,\"error\":1}",
                                        "{\"Error\":1}", "{\"a\":{\"error\":1}}"}) {
        BOOST_TEST(!cles::protocol::begins_with_error(good), good);
    }
}

BOOST_AUTO_TEST_CASE(rules_that_throw_deny_access) {
    for (const bool known : {true, false}) {
        cles::test::test_node node{{}, [known](const cles::access&) -> bool {
                                       if (known) {
                                           throw std::runtime_error{"the data base is gone"};
                                       }
                                       throw 7;
                                   }};
        node.on(cles::verb::pull, "speed", "{}");
        cles::test::test_link link{node};
        BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 denied");
        BOOST_TEST(link.kind("PULL car1:speed") == "denied");
    }
}

BOOST_AUTO_TEST_CASE(rules_that_throw_do_not_fill_the_log) {
    std::size_t errors = 0;
    cles::test::test_node node{
        {},
        [](const cles::access&) -> bool { throw 7; },
        [&](cles::log_level level, const cles::log_entry&) { errors += level == cles::log_level::error ? 1U : 0U; }};
    cles::test::test_link link{node};
    for (int i = 0; i < 20; ++i) {
        BOOST_TEST(link.kind("PULL car1:speed id=7") == "id=7 denied");
    }
    BOOST_TEST(errors == 8U);
}

BOOST_AUTO_TEST_CASE(a_node_finds_itself_in_via_by_its_whole_name) {
    BOOST_TEST(cles::core::is_in_via("car1", "car1"));
    BOOST_TEST(cles::core::is_in_via("car2,car1,car3", "car1"));
    BOOST_TEST(cles::core::is_in_via("car2,car1", "car1"));
    BOOST_TEST(!cles::core::is_in_via("", "car1"));
    BOOST_TEST(!cles::core::is_in_via("car11,xcar1", "car1"));
    BOOST_TEST(!cles::core::is_in_via("Car1", "car1"));
}

BOOST_AUTO_TEST_CASE(the_noun_of_a_cancellation_holds_the_id) {
    BOOST_TEST(cancelled("self:cles/cancel/7").value() == 7U);
    BOOST_TEST(cancelled("self:cles/cancel/9223372036854775807").value() == 9'223'372'036'854'775'807U);
    for (const std::string_view other :
         {"self:cles/cancel", "self:cles/cancel/7/8", "self:cles/cancel/x", "self:cles/cancel/07", "self:cles/cancel/0",
          "self:cles/cancel/9223372036854775808", "self:cles/stop/7", "self:Cles/cancel/7", "self:log/cancel/7"}) {
        BOOST_TEST(!cancelled(other).has_value(), other);
    }
}

BOOST_AUTO_TEST_SUITE_END()
