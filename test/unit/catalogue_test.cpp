// SPDX-License-Identifier: BSL-1.0
#include "core/catalogue.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <string>

namespace catalogue {
namespace {

using namespace std::chrono_literals;

struct fixture : cles::test::routing_fixture {
    std::string offered_by(cles::verb v, std::string_view what) {
        std::vector<std::string> names;
        for (const auto& o : routing->offers(v, what)) {
            names.push_back(o.by->name + (o.idempotent ? "!" : ""));
        }
        std::sort(names.begin(), names.end());
        std::string all;
        for (const auto& name : names) {
            all.append(all.empty() ? "" : " ").append(name);
        }
        return all;
    }
    void hear_at(const std::string& name, const std::string& url, const std::string& digest) {
        node.host->others.hear({.node = name, .endpoints = {url}, .interval = 60s, .tasks = digest}, run_of(name),
                               ++seq[name], from(name), node.clock.now());
    }
    void fail_all() {
        while (ways.count_open() != 0) {
            ways.open().fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
        }
    }
};

} // namespace
} // namespace catalogue

BOOST_FIXTURE_TEST_SUITE(catalogue, fixture)

using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(who_appears_is_asked_what_it_offers) {
    hear("car2");
    BOOST_TEST(ways.to("car2").text == "PULL car2:cles");
    BOOST_TEST(routing->expects_more());
    ways.to("car2").answers(description("car2", task("PULL", "speed") + "," + task("DELEGATE", "work", true)));
    BOOST_TEST(!routing->expects_more());
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
    BOOST_TEST(offered_by(verb::delegate, "work") == "car2!");
    BOOST_TEST(offered_by(verb::push, "speed").empty());
    BOOST_TEST(offered_by(verb::pull, "cles") == "car2!");
}

BOOST_AUTO_TEST_CASE(the_same_digest_is_not_asked_again) {
    offer("car2", task("PULL", "speed"));
    const auto before = ways.count();
    hear("car2", "of car2");
    BOOST_TEST(ways.count() == before);
}

BOOST_AUTO_TEST_CASE(another_digest_is_asked_and_until_then_the_old_list_holds) {
    offer("car2", task("PULL", "speed"));
    hear("car2", "another");
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
    BOOST_TEST(!routing->expects_more());
    ways.to("car2").answers(description("car2", task("PULL", "height")));
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
    BOOST_TEST(offered_by(verb::pull, "height") == "car2");
    BOOST_TEST(offered_by(verb::pull, "cles") == "car2!");
}

BOOST_AUTO_TEST_CASE(nodes_of_one_digest_are_asked_once) {
    hear("car2", "same");
    hear("car3", "same");
    BOOST_TEST(ways.count() == 1U);
    ways.open().answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2 car3");
    hear("car4", "same");
    BOOST_TEST(ways.count() == 1U);
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2 car3 car4");
}

BOOST_AUTO_TEST_CASE(where_one_of_a_digest_does_not_answer_another_is_asked) {
    hear("car2", "same");
    hear("car3", "same");
    ways.to("car2").fails(errc::deadline, "no answer came in time");
    BOOST_TEST(ways.to("car3").text == "PULL car3:cles");
    ways.to("car3").answers(description("car3", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2 car3");
}

BOOST_AUTO_TEST_CASE(no_digest_is_like_no_other) {
    hear("car2", "");
    hear("car3", "");
    BOOST_TEST(ways.count_open() == 2U);
}

BOOST_AUTO_TEST_CASE(who_did_not_say_is_asked_again_after_a_while) {
    hear("car2");
    ways.to("car2").fails(errc::unavailable, "the link was lost");
    BOOST_TEST(!routing->expects_more());
    BOOST_TEST(ways.count_open() == 0U);
    node.pass(2s);
    BOOST_TEST(ways.count_open() == 1U);
    ways.open().answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
}

BOOST_AUTO_TEST_CASE(what_another_says_of_itself_does_not_count) {
    hear("car2");
    ways.to("car2").answers(description("car3", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
}

BOOST_AUTO_TEST_CASE(who_leaves_offers_nothing) {
    offer("car2", task("PULL", "speed"));
    offer("car3", task("PULL", "speed"));
    leave("car2");
    BOOST_TEST(offered_by(verb::pull, "speed") == "car3");
    BOOST_TEST(offered_by(verb::pull, "cles") == "car3!");
    leave("car3");
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
}

BOOST_AUTO_TEST_CASE(an_answer_of_one_that_has_left_is_nothing) {
    hear("car2");
    leave("car2");
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
    BOOST_TEST(routing->find("car2") == nullptr);
}

BOOST_AUTO_TEST_CASE(no_more_than_sixteen_are_asked_at_once) {
    for (int i = 0; i < 20; ++i) {
        hear("n" + std::to_string(i), "digest " + std::to_string(i));
    }
    BOOST_TEST(ways.count_open() == 16U);
    const auto name = ways.open().node;
    ways.open().answers(description(name, task("PULL", "speed")));
    BOOST_TEST(ways.count_open() == 16U);
}

BOOST_AUTO_TEST_CASE(names_without_end_at_a_closed_port_are_hardly_asked_at_all) {
    for (int i = 0; i < 1024; ++i) {
        hear_at("fake" + std::to_string(i), "tcp://127.0.0.1:9", "digest " + std::to_string(i));
        fail_all();
    }
    BOOST_TEST(ways.count() <= 2U);
    for (int i = 0; i < 600; ++i) {
        node.pass(100ms);
        fail_all();
    }
    BOOST_TEST(ways.count() <= 10U); // of one at a time, after pauses that grow
    leave("fake0");                  // there is room again
    offer("car2", task("PULL", "speed"));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
}

BOOST_AUTO_TEST_CASE(who_is_suspect_is_not_asked_until_it_is_heard_again) {
    hear("car2");
    ways.to("car2").fails(errc::unavailable, "the link was lost");
    const auto before = ways.count();
    for (int i = 0; i < 100; ++i) {
        node.pass(100ms); // it is suspect after 3.5 s
        if (ways.count_open() != 0) {
            ways.open().fails(errc::unavailable, "the link was lost");
        }
    }
    BOOST_TEST(ways.count() == before + 1); // after 2 s
    hear("car2");
    BOOST_TEST(ways.count_open() == 1U);
}

BOOST_AUTO_TEST_CASE(who_does_not_say_within_a_second_is_not_waited_for) {
    for (int i = 0; i < 40; ++i) { // of which no more than some are asked
        hear("n" + std::to_string(i), "digest " + std::to_string(i));
    }
    node.pass(999ms);
    BOOST_TEST(routing->expects_more());
    node.pass(1ms);
    BOOST_TEST(!routing->expects_more());
}

BOOST_AUTO_TEST_CASE(one_that_moves_is_asked_where_it_is_now) {
    hear("car2");
    ways.to("car2").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    BOOST_TEST(ways.count_open() == 0U);
    hear_at("car2", "tcp://127.0.0.1:2", "d");
    BOOST_TEST(ways.count_open() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
