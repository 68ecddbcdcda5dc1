// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "sgd/order.hpp"
#include "sgd/tasks.hpp"
#include "sgd/training.hpp"
#include "support/answer.hpp"
#include "support/asked_node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <string>

namespace sgd_tasks {
namespace {

struct fixture : cles::test::asked_node {
    fixture() { sgd::register_tasks(node, {.per_class = 1'000}); }
};

} // namespace
} // namespace sgd_tasks

BOOST_FIXTURE_TEST_SUITE(sgd_tasks, fixture)

BOOST_AUTO_TEST_CASE(its_jobs_stay_on_this_node) {
    BOOST_TEST(ask("PULL self:cles").find("\"local\":true") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(the_data_is_told) {
    BOOST_TEST(ask("PULL self:sgd") == R"({"seed":1,"per_class":1000,"separation":7})");
}

BOOST_AUTO_TEST_CASE(a_shard_is_trained_on) {
    const auto answer = cles::from_json<sgd::trained>(
        ask(R"(DELEGATE self:sgd/train {"first":500,"count":1000,"epochs":3,"rate":0.001,"seed":9})"));
    const sgd::data_set data{sgd::recipe{.per_class = 1'000}};
    sgd::training work{data, {500, 1'000}, {.steps = 3'000, .rate = 0.001, .seed = 9}};
    while (work.step()) {
    }
    BOOST_TEST((answer.result == work.result())); // bit by bit
    BOOST_TEST(answer.node == "node");
    BOOST_TEST(answer.points == 1'000U);
    BOOST_TEST(answer.steps == 3'000U);
    BOOST_TEST(answer.ms > 0);
    BOOST_TEST(!answer.after_ms);
}

BOOST_AUTO_TEST_CASE(it_begins_where_it_is_told) {
    const auto answer = cles::from_json<sgd::trained>(
        ask(R"(DELEGATE self:sgd/train {"first":0,"count":1,"rate":1e-300,"start":{"weights":[3,4],"bias":5}})"));
    BOOST_TEST((answer.result == sgd::classifier{{3, 4}, 5}));
}

BOOST_AUTO_TEST_CASE(what_cannot_be_is_refused) {
    const auto refused = [&](const std::string& body) { return ask("DELEGATE self:sgd/train " + body); };
    BOOST_TEST(ask("DELEGATE self:sgd {}").starts_with("bad_request"));
    BOOST_TEST(ask("DELEGATE self:sgd/test {}").starts_with("bad_request"));
    BOOST_TEST(refused("{}").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":0,"count":0})").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":1999,"count":2})") == "bad_request: node: 2 points from point 1999: there are 2000");
    BOOST_TEST(refused(R"({"first":18446744073709551615,"count":2})").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":1,"count":18446744073709551615})").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":0,"count":9,"epochs":0})") == "bad_request: node: epochs: 1 to 1000000");
    BOOST_TEST(refused(R"({"first":0,"count":9,"epochs":1000001})").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":0,"count":9,"rate":0})") == "bad_request: node: rate: more than 0");
    BOOST_TEST(refused(R"({"first":0,"count":9,"rate":"fast"})").starts_with("bad_request"));
    BOOST_TEST(refused(R"({"first":0,"count":9,"rate":-1})").starts_with("bad_request"));
}

BOOST_AUTO_TEST_CASE(other_data_is_refused) {
    BOOST_TEST(
        ask(R"(DELEGATE self:sgd/train {"first":0,"count":9,"data":{"seed":2,"per_class":1000,"separation":7}})") ==
        "bad_request: node: this node has other data: 1000 points per class, 7 apart, from seed 1");
    BOOST_TEST(ask(R"(DELEGATE self:sgd/train {"first":0,"count":9,"data":{"seed":1,"per_class":1000,"separation":7}})")
                   .starts_with(R"({"node":"node")"));
}

BOOST_AUTO_TEST_CASE(a_rate_that_is_too_large_fails) {
    BOOST_TEST(ask(R"(DELEGATE self:sgd/train {"first":0,"count":2000,"epochs":100,"rate":1})") ==
               "failed: node: it does not converge: the rate is too large");
}

BOOST_AUTO_TEST_CASE(it_tells_how_far_it_is) {
    double last = 0;
    cles::test::answer<> a;
    node.async_request(R"(DELEGATE self:sgd/train {"first":0,"count":2000,"epochs":200})",
                       a.options().on_progress([&](double part, std::string_view) {
                           BOOST_TEST(part > last);
                           last = part;
                       }),
                       a.take());
    cles::test::run_until(io, [&] { return a.done(); });
    BOOST_TEST(last > 0.8);
}

BOOST_AUTO_TEST_CASE(settings_are_kept_within_bounds) {
    cles::service other{io, {.name = "other"}};
    BOOST_CHECK_THROW(sgd::register_tasks(other, {.per_class = 0}), cles::error);
    BOOST_CHECK_THROW(sgd::register_tasks(other, {.per_class = 10'000'001}), cles::error);
    sgd::register_tasks(other, {.seed = 5, .per_class = 10, .separation = 1.5});
    BOOST_TEST(other.request("PULL self:sgd") == R"({"seed":5,"per_class":10,"separation":1.5})");
}

BOOST_AUTO_TEST_SUITE_END()
