// SPDX-License-Identifier: BSL-1.0
#include <cles/owned_request.hpp>
#include <cles/request.hpp>

#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(owned_request)

using namespace std::chrono_literals;

struct fixture {
    void keep(std::string node, std::string task, std::string parameter, std::string body) {
        const std::array<std::string_view, 2> parameters{parameter, "second"};
        const cles::identity from{.transport = "tcp", .address = "tcp://127.0.0.1:9", .name = {}, .uid = {}};
        const cles::detail::request_data data{.verb = cles::verb::delegate,
                                              .node = node,
                                              .task = task,
                                              .parameters = parameters,
                                              .body = body,
                                              .peer = &from,
                                              .deadline = cles::time_point{5s}};
        kept.assign(cles::request{data}, peer);
    } // the originals are destroyed now

    std::shared_ptr<const cles::identity> peer = std::make_shared<cles::identity>(
        cles::identity{.transport = "tcp", .address = "tcp://127.0.0.1:9", .name = {}, .uid = {}});
    cles::detail::owned_request kept;
    const cles::request view{kept.data()};
};

BOOST_FIXTURE_TEST_CASE(it_copies_the_whole_request, fixture) {
    keep("car1", "route", "a parameter that is too long for a short string", R"({"to":"Berlin"})");
    const auto& r = view;
    BOOST_TEST((r.verb() == cles::verb::delegate));
    BOOST_TEST(r.node() == "car1");
    BOOST_TEST(r.task() == "route");
    BOOST_TEST(r.parameters().size() == 2U);
    BOOST_TEST(r.parameter(0) == "a parameter that is too long for a short string");
    BOOST_TEST(r.parameter(1) == "second");
    BOOST_TEST(r.body() == R"({"to":"Berlin"})");
    BOOST_TEST(r.peer().address == "tcp://127.0.0.1:9");
    BOOST_TEST((r.deadline() == cles::time_point{5s}));
}

BOOST_FIXTURE_TEST_CASE(the_next_one_replaces_it, fixture) {
    keep("car1", "route", "x", std::string(100'000, ' ') + "{}");
    kept.clear();
    keep("car1", "speed", "y", "[1]");
    BOOST_TEST(view.task() == "speed");
    BOOST_TEST(view.parameter(0) == "y");
    BOOST_TEST(view.body() == "[1]");
    BOOST_TEST(peer.use_count() == 2);
    kept.clear();
    BOOST_TEST(peer.use_count() == 1);
}

BOOST_FIXTURE_TEST_CASE(a_copy_of_the_request_is_independent, fixture) {
    keep("car1", "route", "x", "[1]");
    const auto copy = view;
    keep("car2", "speed", "y", "[2]");
    BOOST_TEST(copy.node() == "car1");
    BOOST_TEST(copy.body() == "[1]");
}

BOOST_AUTO_TEST_SUITE_END()
