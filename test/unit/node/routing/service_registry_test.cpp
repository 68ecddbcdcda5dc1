// SPDX-License-Identifier: BSL-1.0
#include "node/routing/service_registry.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <string>

namespace service_registry {
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
        node.host->peers.apply_announcement({.node = name, .endpoints = {url}, .interval = 60s, .tasks = digest},
                                            run_of(name), ++seq[name], from(name), node.clock.now());
    }
    /// As many failures as are allowed at once: queries have to wait for their turn then.
    void use_up_failures() {
        int failed = 0;
        do {
            hear_at("n" + std::to_string(failed), "tcp://127.0.0.1:" + std::to_string(100 + failed), "");
            fail_all();
            BOOST_REQUIRE_LT(++failed, 100);
        } while (ways.count() == static_cast<std::size_t>(failed));
        leave("n" + std::to_string(failed - 1));
    }
    static std::string url_of(const std::string& name) { return "tcp://127.0.0.1:" + name.substr(name.size() - 1); }
    /// Three nodes of one digest; returns them in the order of their turns. The first one is being asked.
    std::array<std::string, 3> ask_one_of_three() {
        for (int i = 1; i <= 3; ++i) {
            const auto name = "same" + std::to_string(i);
            hear_at(name, url_of(name), "same");
        }
        node.pass(50ms);
        const auto first = ways.open().node;
        return {first, first == "same1" ? "same2" : "same1", first == "same3" ? "same2" : "same3"};
    }
    void fail_all() {
        while (ways.count_open() != 0) {
            ways.open().fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
        }
    }
};

} // namespace
} // namespace service_registry

BOOST_FIXTURE_TEST_SUITE(service_registry, fixture)

using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(new_node_is_asked_for_its_tasks) {
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

BOOST_AUTO_TEST_CASE(changed_digest_is_queried_and_the_old_list_holds_until_then) {
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

BOOST_AUTO_TEST_CASE(if_one_node_of_a_digest_does_not_answer_another_is_asked) {
    hear("car2", "same");
    hear("car3", "same");
    ways.to("car2").fails(errc::deadline, "no answer was received in time");
    BOOST_TEST(ways.to("car3").text == "PULL car3:cles");
    ways.to("car3").answers(description("car3", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2 car3");
}

// Whichever comes first, the failure of the query or the end of the second.
BOOST_AUTO_TEST_CASE(a_node_that_waits_for_another_of_its_digest_is_waited_for_when_its_turn_comes) {
    for (const bool failure_is_first : {true, false}) {
        const std::string digest = failure_is_first ? "one" : "another";
        const std::string offered = digest + "_task";
        const auto name = [&](int number) { return digest + std::to_string(number); };
        for (int i = 1; i <= 3; ++i) {
            hear(name(i), digest);
        }
        for (int i = 1; i <= 2; ++i) {
            node.pass(failure_is_first ? 999ms : 1000ms);
            BOOST_TEST(routing->expects_more());
            ways.to(name(i)).fails(errc::deadline, "no answer was received in time");
            BOOST_TEST(routing->expects_more());
        }
        node.pass(999ms);
        BOOST_TEST(routing->expects_more());
        ways.to(name(3)).answers(description(name(3), task("PULL", offered)));
        BOOST_TEST(!routing->expects_more());
        BOOST_TEST(offered_by(verb::pull, offered) == name(1) + " " + name(2) + " " + name(3));
    }
}

// Those that did not answer are asked again after two seconds, but do not overtake.
BOOST_AUTO_TEST_CASE(a_live_node_is_waited_for_behind_many_silent_ones_of_its_digest) {
    for (int i = 1; i <= 9; ++i) {
        hear_at("n" + std::to_string(i), "tcp://127.0.0.1:" + std::to_string(i), "same");
    }
    for (int silent = 0; offered_by(verb::pull, "speed").empty(); ++silent) {
        BOOST_REQUIRE_LT(silent, 20);
        node.pass(999ms);
        BOOST_REQUIRE(routing->expects_more());
        if (ways.open().text == "PULL n9:cles") {
            ways.open().answers(description("n9", task("PULL", "speed")));
        } else {
            node.pass(1ms);
            BOOST_REQUIRE(routing->expects_more());
            ways.open().fails(errc::deadline, "no answer was received in time");
        }
    }
    BOOST_TEST(!routing->expects_more());
}

BOOST_AUTO_TEST_CASE(a_node_is_asked_if_the_one_before_it_of_its_digest_has_left_before_its_turn) {
    use_up_failures();
    const auto [first, second, third] = ask_one_of_three();
    ways.open().fails(errc::deadline, "no answer was received in time");
    BOOST_TEST(ways.count_open() == 0U);
    leave(second);
    node.pass(500ms);
    BOOST_TEST(ways.count_open() == 1U);
    BOOST_TEST(ways.to(third).text == "PULL " + third + ":cles");
}

BOOST_AUTO_TEST_CASE(a_node_is_asked_if_the_url_of_the_one_before_it_of_its_digest_fails_before_its_turn) {
    use_up_failures();
    const auto [first, second, third] = ask_one_of_three();
    hear_at("other", url_of(second), "");
    ways.to(first).fails(errc::deadline, "no answer was received in time");
    BOOST_TEST(routing->expects_more());
    ways.to("other").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    BOOST_TEST(ways.count_open() == 0U);
    node.pass(500ms);
    BOOST_TEST(ways.count_open() == 1U);
    BOOST_TEST(ways.to(third).text == "PULL " + third + ":cles");
    node.pass(999ms);
    BOOST_TEST(routing->expects_more());
    ways.to(third).answers(description(third, task("PULL", "speed")));
    BOOST_TEST(!routing->expects_more());
    BOOST_TEST(offered_by(verb::pull, "speed") == "same1 same2 same3");
}

BOOST_AUTO_TEST_CASE(nodes_at_a_closed_port_do_not_delay_another_of_their_digest) {
    for (int i = 1; i <= 5; ++i) {
        hear_at("dead" + std::to_string(i), "tcp://127.0.0.1:9", "same");
    }
    hear_at("live", "tcp://127.0.0.1:1", "same");
    ways.to("dead1").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    BOOST_TEST(ways.open().text == "PULL live:cles");
    ways.open().answers(description("live", task("PULL", "speed")));
    BOOST_TEST(!routing->expects_more());
}

BOOST_AUTO_TEST_CASE(requests_wait_for_a_new_node_at_a_closed_port_after_its_pause) {
    hear_at("old", "tcp://127.0.0.1:9", "one");
    fail_all();
    leave("old");
    hear_at("early", "tcp://127.0.0.1:9", "two");
    BOOST_TEST(ways.count_open() == 0U);
    BOOST_TEST(!routing->expects_more());
    leave("early");
    node.pass(2s);
    hear_at("late", "tcp://127.0.0.1:9", "three");
    BOOST_TEST(ways.open().text == "PULL late:cles");
    BOOST_TEST(routing->expects_more());
}

BOOST_AUTO_TEST_CASE(nodes_without_a_digest_are_asked_separately) {
    hear("car2", "");
    hear("car3", "");
    BOOST_TEST(ways.count_open() == 2U);
}

BOOST_AUTO_TEST_CASE(node_that_did_not_answer_is_asked_again_later) {
    hear("car2");
    ways.to("car2").fails(errc::unavailable, "the link was lost");
    BOOST_TEST(!routing->expects_more());
    BOOST_TEST(ways.count_open() == 0U);
    node.pass(2s);
    BOOST_TEST(ways.count_open() == 1U);
    ways.open().answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
}

BOOST_AUTO_TEST_CASE(description_of_another_node_does_not_count) {
    hear("car2");
    ways.to("car2").answers(description("car3", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
}

BOOST_AUTO_TEST_CASE(left_node_offers_nothing) {
    offer("car2", task("PULL", "speed"));
    offer("car3", task("PULL", "speed"));
    leave("car2");
    BOOST_TEST(offered_by(verb::pull, "speed") == "car3");
    BOOST_TEST(offered_by(verb::pull, "cles") == "car3!");
    leave("car3");
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
}

BOOST_AUTO_TEST_CASE(reply_of_a_left_node_is_ignored) {
    hear("car2");
    leave("car2");
    ways.to("car2").answers(description("car2", task("PULL", "speed")));
    BOOST_TEST(offered_by(verb::pull, "speed").empty());
    BOOST_TEST(routing->find("car2") == nullptr);
}

BOOST_AUTO_TEST_CASE(at_most_sixteen_are_asked_at_once) {
    for (int i = 0; i < 20; ++i) {
        hear("n" + std::to_string(i), "digest " + std::to_string(i));
    }
    BOOST_TEST(ways.count_open() == 16U);
    const auto name = ways.open().node;
    ways.open().answers(description(name, task("PULL", "speed")));
    BOOST_TEST(ways.count_open() == 16U);
}

BOOST_AUTO_TEST_CASE(many_names_at_a_closed_port_cause_few_queries) {
    for (int i = 0; i < 1024; ++i) {
        hear_at("fake" + std::to_string(i), "tcp://127.0.0.1:9", "digest " + std::to_string(i));
        fail_all();
    }
    BOOST_TEST(ways.count() <= 2U);
    for (int i = 0; i < 600; ++i) {
        node.pass(100ms);
        fail_all();
    }
    BOOST_TEST(ways.count() <= 10U); // one at a time, after growing pauses
    leave("fake0");                  // there is capacity again
    offer("car2", task("PULL", "speed"));
    BOOST_TEST(offered_by(verb::pull, "speed") == "car2");
}

BOOST_AUTO_TEST_CASE(suspect_node_is_not_asked_until_received_again) {
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

BOOST_AUTO_TEST_CASE(node_without_a_reply_is_waited_for_at_most_a_second) {
    for (int i = 0; i < 40; ++i) { // more than are asked at once
        hear("n" + std::to_string(i), "digest " + std::to_string(i));
    }
    node.pass(999ms);
    BOOST_TEST(routing->expects_more());
    node.pass(1ms);
    BOOST_TEST(!routing->expects_more());
}

BOOST_AUTO_TEST_CASE(node_that_moves_is_asked_at_its_new_address) {
    hear("car2");
    ways.to("car2").fails(boost::system::errc::make_error_code(boost::system::errc::connection_refused), "refused");
    BOOST_TEST(ways.count_open() == 0U);
    hear_at("car2", "tcp://127.0.0.1:2", "d");
    BOOST_TEST(ways.count_open() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()
