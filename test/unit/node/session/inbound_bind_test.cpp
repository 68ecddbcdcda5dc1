// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace inbound_bind {
namespace {

using cles::verb;
using namespace std::chrono_literals;

struct fixture {
    fixture() { node.open("pose"); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

std::string update(std::string_view noun, int seq, std::string_view body) {
    return "UPDATE car1:" + std::string{noun} + " seq=" + std::to_string(seq) + " epoch=5f3a09c1 " + std::string{body} +
           "\n";
}

} // namespace
} // namespace inbound_bind

BOOST_FIXTURE_TEST_SUITE(inbound_bind, fixture)

BOOST_AUTO_TEST_SUITE(binding)

BOOST_AUTO_TEST_CASE(the_reply_is_an_empty_object_before_the_first_update) {
    BOOST_TEST(link.ask("BIND car1:pose id=7") == "id=7 {}\n");
}

BOOST_AUTO_TEST_CASE(with_mark_the_reply_names_the_update_it_holds) {
    BOOST_TEST(link.ask("BIND car1:pose id=7 mark=yes") == "id=7 {}\n"); // none
    node.publish_now("pose", "{\"x\":1}");
    node.publish_now("pose", "{\"x\":2}");
    link.take();
    cles::test::test_link other{node};
    BOOST_TEST(other.ask("BIND car1:pose id=5 mark=yes") == "id=5 seq=2 epoch=5f3a09c1 {\"x\":2}\n");
    BOOST_TEST(other.ask("BIND car1:pose id=6") == "id=6 {\"x\":2}\n");
    BOOST_TEST(other.ask("BIND car1:pose mark=yes") == "{\"x\":2}\n"); // a reply without an id has no mark
    BOOST_TEST(other.kind("BIND car1:pose id=8 mark=maybe") == "id=8 bad_request");
    BOOST_TEST(other.ask("BIND car1:pose id=9 mark=yes lease=0") == "id=9 {}\n");
}

BOOST_AUTO_TEST_CASE(the_reply_is_the_nouns_last_update) {
    node.publish_now("pose", "{\"x\":1}");
    node.publish_now("pose", "{\"x\":2}");
    BOOST_TEST(link.ask("BIND car1:pose id=7") == "id=7 {\"x\":2}\n");
}

BOOST_AUTO_TEST_CASE(updates_follow_with_the_publishers_name_seq_and_epoch) {
    link.ask("BIND self:pose");
    node.publish_now("pose", "[1]");
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take() == update("pose", 1, "[1]") + update("pose", 2, "[2]"));
}

BOOST_AUTO_TEST_CASE(no_update_precedes_the_reply) {
    node.publish("pose", "[1]"); // published, not sent to subscribers yet
    BOOST_TEST(link.ask("BIND car1:pose") == "[1]\n");
    node.drain();
    BOOST_TEST(link.take().empty()); // the reply contained it
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take() == update("pose", 2, "[2]"));
}

BOOST_AUTO_TEST_CASE(one_binding_per_link_and_noun_and_binding_again_replaces_it) {
    link.ask("BIND car1:pose");
    link.ask("BIND car1:pose");
    link.ask("BIND self:pose id=7");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take() == update("pose", 1, "[1]")); // once
    link.ask("BIND car1:pose lease=0");
    BOOST_TEST(link.session().serving().bindings() == 0U);
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(the_terms_of_the_last_bind_count) {
    link.ask("BIND car1:pose every=60000");
    node.publish_now("pose", "[1]");
    link.take();
    BOOST_TEST(link.ask("BIND car1:pose") == "[1]\n");
    node.publish_now("pose", "[2]");
    node.publish_now("pose", "[3]");
    BOOST_TEST(link.take() == update("pose", 2, "[2]") + update("pose", 3, "[3]"));
    link.ask("BIND car1:pose every=1000");
    node.publish_now("pose", "[4]");
    node.publish_now("pose", "[5]");
    BOOST_TEST(link.take() == update("pose", 4, "[4]")); // the first at once
    node.pass(1000ms);
    BOOST_TEST(link.take() == update("pose", 5, "[5]"));
}

BOOST_AUTO_TEST_CASE(updates_contained_in_the_reply_do_not_follow_it) {
    link.ask("BIND car1:pose every=1000");
    for (const std::string_view body : {"[1]", "[2]", "[3]"}) {
        node.publish_now("pose", body);
    }
    link.take();
    BOOST_TEST(link.ask("BIND car1:pose") == "[3]\n");
    node.pass(1h);
    node.publish_now("pose", "[4]");
    BOOST_TEST(link.take() == update("pose", 4, "[4]"));
}

BOOST_AUTO_TEST_CASE(each_link_has_its_own_binding) {
    cles::test::test_link other{node};
    link.ask("BIND car1:pose");
    other.ask("BIND car1:pose");
    link.ask("BIND car1:pose lease=0");
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take().empty());
    BOOST_TEST(other.take() == update("pose", 1, "[1]"));
}

BOOST_AUTO_TEST_CASE(parameters_belong_to_the_noun) {
    link.ask("BIND car1:pose/fast");
    node.publish_now("pose", "[1]");
    node.publish_now("pose/slow", "[2]");
    BOOST_TEST(link.take().empty());
    node.publish_now("pose/fast", "[3]");
    BOOST_TEST(link.take() == update("pose/fast", 1, "[3]"));
}

BOOST_AUTO_TEST_CASE(nouns_are_compared_decoded) {
    link.ask("BIND car1:pose/a%41");
    link.ask("BIND car1:pose/aA");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    node.publish_now("pose/aA", "[1]");
    BOOST_TEST(link.take() == update("pose/aA", 1, "[1]"));
    link.ask("BIND car1:pose/%61A lease=0");
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(on_a_stream_a_binding_lives_as_long_as_its_link) {
    link.ask("BIND car1:pose lease=1");
    node.pass(24h);
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take() == update("pose", 1, "[1]"));
}

BOOST_AUTO_TEST_CASE(a_published_task_can_be_bound_and_an_unknown_one_cannot) {
    BOOST_TEST(link.kind("BIND car1:load") == "no_task");
    node.publish_now("load/left", "[1]");
    BOOST_TEST(link.kind("BIND car1:load") == "ok");
    BOOST_TEST(link.ask("BIND car1:load/left") == "[1]\n");
    node.on(verb::pull, "speed", "[1]");
    BOOST_TEST(link.kind("BIND car1:speed") == "no_task");
}

BOOST_AUTO_TEST_CASE(a_handler_may_refuse_a_bind) {
    int asked = 0;
    node.on(verb::bind, "zone", [&](const cles::request& r, cles::json_writer& w) {
        ++asked;
        w.value(std::string_view{"unused"});
        if (r.parameter(0) != "a b") {
            throw cles::error{cles::errc::bad_request, "there is no zone " + std::string{r.parameter(0)}};
        }
    });
    BOOST_TEST(link.ask("BIND car1:zone/x") ==
               "{\"error\":\"bad_request\",\"message\":\"car1: there is no zone x\"}\n");
    BOOST_TEST(link.session().serving().bindings() == 0U);
    BOOST_TEST(link.ask("BIND car1:zone/a%20b") == "{}\n");
    BOOST_TEST(link.session().serving().bindings() == 1U);
    BOOST_TEST(asked == 2);
    BOOST_TEST(link.kind("BIND car1:zone/x lease=0") == "ok"); // an unbind does not call the handler
    BOOST_TEST(asked == 2);
}

BOOST_AUTO_TEST_CASE(a_bind_without_id_waits_its_turn) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car1:work");
    BOOST_TEST(link.ask("BIND car1:pose").empty());
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.take().empty());
    node.started.at(0)->call->done("[9]");
    BOOST_TEST(link.take() == "[9]\n[1]\n");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(unbinding)

BOOST_AUTO_TEST_CASE(unbinding_nothing_is_an_empty_object) {
    BOOST_TEST(link.ask("BIND car1:pose id=7 lease=0") == "id=7 {}\n");
    BOOST_TEST(link.ask("BIND car1:nothing/known lease=0") == "{}\n");
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n"); // not the last update
}

BOOST_AUTO_TEST_CASE(no_update_follows_an_unbinds_reply) {
    link.ask("BIND car1:pose");
    node.publish("pose", "[1]");
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n");
    node.drain();
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(no_thinned_update_follows_an_unbinds_reply) {
    link.ask("BIND car1:pose every=100");
    node.publish_now("pose", "[1]");
    node.publish_now("pose", "[2]");
    link.take();
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n");
    node.pass(1h);
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(no_update_that_waited_follows_an_unbinds_reply) {
    link.ask("BIND car1:pose");
    link.takes = false;
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.ask("BIND car1:pose lease=0") == "{}\n");
    link.make_writable();
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(binding_after_an_unbind_starts_with_the_last_update) {
    link.ask("BIND car1:pose");
    link.ask("BIND car1:pose lease=0");
    node.publish_now("pose", "[1]");
    BOOST_TEST(link.ask("BIND car1:pose") == "[1]\n");
    node.publish_now("pose", "[2]");
    BOOST_TEST(link.take() == update("pose", 2, "[2]"));
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(slow_links)

BOOST_AUTO_TEST_CASE(the_oldest_is_dropped_and_the_seq_shows_the_gap) {
    link.ask("BIND car1:pose keep=2");
    node.publish_now("pose", "[1]");
    link.take();
    link.takes = false;
    for (const std::string_view body : {"[2]", "[3]", "[4]", "[5]"}) {
        node.publish_now("pose", body);
    }
    BOOST_TEST(link.take().empty());
    link.make_writable();
    BOOST_TEST(link.take() == update("pose", 4, "[4]") + update("pose", 5, "[5]"));
    BOOST_TEST(node.counts().updates_shed == 2U);
}

BOOST_AUTO_TEST_CASE(a_slow_subscriber_does_not_affect_others) {
    cles::test::test_link slow{node};
    slow.ask("BIND car1:pose keep=1");
    link.ask("BIND car1:pose keep=1");
    slow.takes = false;
    std::string expected;
    std::string got;
    for (int i = 1; i <= 100; ++i) {
        node.publish_now("pose", "[1]");
        expected += update("pose", i, "[1]");
        got += link.take();
    }
    BOOST_TEST((got == expected));
}

BOOST_AUTO_TEST_CASE(replies_are_not_dropped_for_a_slow_link) {
    node.on(verb::pull, "speed", "[3]");
    link.ask("BIND car1:pose keep=1");
    link.takes = false;
    for (int i = 0; i < 10; ++i) {
        node.publish_now("pose", "[1]");
        link.session().on_line("PULL car1:speed", node.clock.now());
    }
    BOOST_TEST(link.take_lines().size() == 10U);
}

BOOST_AUTO_TEST_CASE(a_waiting_publisher_continues_when_the_slow_subscriber_takes_more) {
    link.ask("BIND car1:pose keep=1");
    link.takes = false;
    node.publish_now("pose", "[1]");
    auto [operation, result] = cles::test::record();
    BOOST_TEST(!node.host->published.publish_or_wait("pose", "[2]", operation));
    node.drain();
    BOOST_TEST(!result->ended);
    link.make_writable();
    node.drain();
    BOOST_TEST(result->ended);
    node.drain();
    BOOST_TEST(link.take() == update("pose", 1, "[1]") + update("pose", 2, "[2]"));
}

BOOST_AUTO_TEST_CASE(a_waiting_publisher_continues_when_the_slow_subscriber_leaves) {
    for (const bool by_reset : {true, false}) {
        std::vector<cles::core::completion> due;
        cles::test::test_node waits{{}, {}, {}, [&](cles::core::completion c) { due.push_back(std::move(c)); }};
        cles::test::test_link slow{waits};
        waits.open("pose");
        slow.ask("BIND car1:pose keep=1");
        slow.takes = false;
        waits.publish_now("pose", "[1]");
        auto [operation, result] = cles::test::record();
        BOOST_TEST(!waits.host->published.publish_or_wait("pose", "[2]", operation));
        if (by_reset) {
            slow.reset();
        } else {
            slow.ask("BIND car1:pose lease=0");
        }
        BOOST_TEST(!result->ended); // not inside a call of the link
        BOOST_REQUIRE(due.size() == 1U);
        due.front()();
        BOOST_TEST(result->ended);
    }
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
