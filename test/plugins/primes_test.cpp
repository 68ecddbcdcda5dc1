// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "primes/primes.hpp"
#include "support/answer.hpp"
#include "support/asked_node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <optional>
#include <string>

namespace primes {
namespace {

struct fixture : cles::test::asked_node {
    fixture() { primes::register_tasks(node, {.limit = 1'000'000, .parts_by = "self"}); }
};

} // namespace
} // namespace primes

BOOST_FIXTURE_TEST_SUITE(primes, fixture)

BOOST_AUTO_TEST_CASE(they_are_reported_and_counted) {
    BOOST_TEST(ask("PULL self:prime/97") == R"({"value":true})");
    BOOST_TEST(ask("PULL self:prime/98") == R"({"value":false})");
    BOOST_TEST(ask("PULL self:prime/x") == "bad_request: node: parameter 1 is not a valid number");
    BOOST_TEST(ask(R"(DELEGATE self:primes {"below":1000000})") == R"({"count":78498,"largest":999983})");
    BOOST_TEST(ask(R"(DELEGATE self:primes {"from":90,"below":100})") == R"({"count":1,"largest":97})");
}

BOOST_AUTO_TEST_CASE(the_limit_is_kept) {
    BOOST_TEST(ask(R"(DELEGATE self:primes {"below":1000001})") ==
               "bad_request: node: 1000001 exceeds the limit of 1000000");
    BOOST_TEST(ask("PULL self:prime/1000001") == "bad_request: node: 1000001 exceeds the limit of 1000000");
    BOOST_CHECK_THROW(::primes::register_tasks(node, {.limit = 2'000'000'000'000, .parts_by = {}}), cles::error);
}

BOOST_AUTO_TEST_CASE(others_count_parts) {
    BOOST_TEST(ask(R"(DELEGATE self:primes_in_parts {"below":1000000,"parts":5})") ==
               R"({"count":78498,"largest":999983})");
    BOOST_TEST(ask(R"(DELEGATE self:primes_in_parts {"below":2000000})") ==
               "bad_request: node: 2000000 exceeds the limit of 1000000");
}

BOOST_AUTO_TEST_CASE(a_part_that_fails_fails_the_whole) {
    cles::service other{io, {.name = "other"}};
    ::primes::register_tasks(other, {.limit = {}, .parts_by = "nobody"});
    BOOST_CHECK_EXCEPTION(other.request(R"(DELEGATE self:primes_in_parts {"below":100})"), cles::error,
                          [](const cles::error& e) {
                              return e.code() == cles::make_error_code(cles::errc::no_target) &&
                                     e.message().find("a part failed: ") != std::string::npos;
                          });
}

BOOST_AUTO_TEST_CASE(progress_is_reported_with_what_has_been_found) {
    double last = 0;
    std::string found;
    cles::test::answer<> a;
    node.async_request(R"(DELEGATE self:primes {"below":1000000})",
                       a.options().on_progress([&](double part, std::string_view json) {
                           BOOST_TEST(part >= last);
                           last = part;
                           found = json;
                       }),
                       a.take());
    cles::test::run_until(io, [&] { return a.done(); });
    BOOST_TEST(last > 0.5);
    BOOST_TEST(found.starts_with(R"({"count":)"));
}

BOOST_AUTO_TEST_SUITE_END()
