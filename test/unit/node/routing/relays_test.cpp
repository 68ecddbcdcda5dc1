// SPDX-License-Identifier: BSL-1.0
#include "node/routing/relays.hpp"
#include "support/routing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <memory>
#include <string>

BOOST_FIXTURE_TEST_SUITE(relays, cles::test::routing_fixture)

using namespace std::chrono_literals;
using cles::errc;
using cles::verb;

BOOST_AUTO_TEST_CASE(binding_is_answered_when_the_other_node_has_replied) {
    BOOST_TEST(link.ask("BIND car2:pose/fast id=7").empty());
    BOOST_TEST(ways.bound("car2:pose/fast").text == "car2:pose/fast hops=7 via=car1");
    ways.bound("car2:pose/fast").binds("{\"x\":1}");
    BOOST_TEST(link.take() == "id=7 {\"x\":1}\n");
}

// A client may repeat a BIND that another node never answers.
BOOST_AUTO_TEST_CASE(waiters_that_have_ended_are_not_kept) {
    const auto from = routing->relayed();
    const auto kept = std::make_shared<int>();
    int told = 0;
    auto waits = std::make_shared<int>();
    cles::protocol::failure why_not;
    const auto permit =
        cles::core::forwarding_permit::ask(*node.host, {}, "car2", verb::bind, "pose", {}, "hops=7 via=car1", why_not);
    BOOST_REQUIRE(permit);
    const auto tell = [kept, &told](auto*, std::string_view, const auto& /*mark*/, const auto& /*why*/) { ++told; };
    for (int i = 0; i < 100; ++i) {
        from->join(*permit, {"pose"}, waits, tell);
        waits = std::make_shared<int>();
    }
    from->join(*permit, {"pose"}, waits, tell);
    BOOST_TEST(kept.use_count() < 5);
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(told == 1);
    BOOST_TEST(kept.use_count() == 2); // this and `tell`
}

BOOST_AUTO_TEST_CASE(updates_are_forwarded_as_received) {
    link.ask("BIND car2:pose");
    ways.bound("car2:pose").binds("{}");
    link.take();
    const auto line = ways.bound("car2:pose").publishes("{\"x\":1}");
    BOOST_TEST(node.wakes == 1);
    drain();
    BOOST_TEST(link.take() == line);
}

BOOST_AUTO_TEST_CASE(no_update_precedes_the_reply) {
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{\"x\":1}");
    ways.bound("car2:pose").publishes("{\"x\":2}");
    drain();
    const auto lines = link.take_lines();
    BOOST_REQUIRE_EQUAL(lines.size(), 2U);
    BOOST_TEST(lines[0] == "id=7 {\"x\":1}");
    BOOST_TEST(lines[1].ends_with("{\"x\":2}"));
}

BOOST_AUTO_TEST_CASE(a_noun_is_bound_once_for_all_clients) {
    cles::test::test_link other{node};
    link.ask("BIND car2:pose id=7");
    other.ask("BIND car2:pose id=8 every=100 keep=3");
    BOOST_TEST(ways.count_bound() == 1U);
    ways.bound("car2:pose").binds("{\"x\":1}");
    BOOST_TEST(link.take() == "id=7 {\"x\":1}\n");
    BOOST_TEST(other.take() == "id=8 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(later_client_gets_the_last_value_at_once) {
    cles::test::test_link other{node};
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{\"x\":1}");
    BOOST_TEST(other.ask("BIND car2:pose id=8") == "id=8 {\"x\":1}\n");
    ways.bound("car2:pose").publishes("{\"x\":2}");
    cles::test::test_link third{node};
    BOOST_TEST(third.ask("BIND car2:pose id=9") == "id=9 {\"x\":2}\n");
    ways.bound("car2:pose").binds("{\"x\":3}"); // bound again
    cles::test::test_link fourth{node};
    BOOST_TEST(fourth.ask("BIND car2:pose id=9") == "id=9 {\"x\":3}\n");
    BOOST_TEST(ways.count_bound() == 1U);
}

BOOST_AUTO_TEST_CASE(returning_publisher_is_reported_with_its_last_value) {
    link.ask("BIND car2:pose id=7");
    auto& feed = ways.bound("car2:pose");
    feed.binds("{\"x\":1}");
    feed.publishes("{\"x\":2}");
    drain();
    link.take();
    const auto line = feed.binds_again(5, "{\"x\":9}");
    drain();
    BOOST_TEST(link.take() == line);
    cles::test::test_link other{node};
    BOOST_TEST(other.ask("BIND car2:pose id=8 mark=yes") == "id=8 seq=5 epoch=0000cafe {\"x\":9}\n");
    BOOST_TEST(other.ask("BIND car2:pose id=9") == "id=9 {\"x\":9}\n");
}

BOOST_AUTO_TEST_CASE(existing_bindings_are_renewed_at_the_limit) {
    cles::test::test_node small{{.bindings = 1}};
    cles::test::recorded_next_hop others;
    const auto routes = std::make_shared<cles::core::request_router>(small.host, others, 1, [] {});
    cles::test::test_link datagrams{small, 1200};
    datagrams.ask("BIND car2:pose id=1 lease=1000");
    others.bound("car2:pose").binds("{\"x\":1}");
    datagrams.take();
    small.pass(900ms);
    BOOST_TEST(datagrams.ask("BIND car2:pose id=2 lease=1000") == "id=2 {\"x\":1}\n");
    BOOST_TEST(datagrams.kind("BIND car2:speed id=3") == "id=3 busy");
    small.pass(900ms); // it was renewed
    others.bound("car2:pose").publishes("{\"x\":2}");
    cles::core::send_updates(small.host->unsent_relayed, small.host->published, small.clock.now());
    BOOST_TEST(datagrams.take().ends_with("{\"x\":2}\n"));
    routes->stop();
}

BOOST_AUTO_TEST_CASE(unmarked_value_is_forwarded_without_a_mark) {
    link.ask("BIND car2:pose id=7 mark=yes");
    BOOST_TEST(ways.bound("car2:pose").text == "car2:pose hops=7 via=car1"); // `mark` holds for one link, like `id`
    ways.bound("car2:pose").binds("{\"x\":1}");
    BOOST_TEST(link.take() == "id=7 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(each_client_is_thinned_and_queued_separately) {
    cles::test::test_link slow{node};
    cles::test::test_link thinned{node};
    link.ask("BIND car2:pose id=7");
    slow.ask("BIND car2:pose id=8 keep=2");
    thinned.ask("BIND car2:pose id=9 every=1000");
    auto& feed = ways.bound("car2:pose");
    feed.binds("{}");
    link.take();
    slow.take();
    thinned.take();
    slow.takes = false;
    for (int i = 1; i <= 5; ++i) {
        feed.publishes("{\"x\":" + std::to_string(i) + "}");
        drain();
    }
    BOOST_TEST(link.take_lines().size() == 5U);
    slow.make_writable();
    const auto late = slow.take_lines();
    BOOST_REQUIRE_EQUAL(late.size(), 2U); // the newest two, and a gap in `seq` before them
    BOOST_TEST(late[0].find("seq=4 ") != std::string::npos);
    BOOST_TEST(thinned.take_lines().size() == 1U);
    node.pass(1s);
    const auto newest = thinned.take_lines();
    BOOST_REQUIRE_EQUAL(newest.size(), 1U);
    BOOST_TEST(newest[0].ends_with("{\"x\":5}"));
}

BOOST_AUTO_TEST_CASE(binding_ends_with_the_last_client) {
    cles::test::test_link other{node};
    link.ask("BIND car2:pose");
    other.ask("BIND car2:pose");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(link.sent() == "ok");
    BOOST_TEST(link.kind("BIND car2:pose lease=0") == "ok");
    BOOST_TEST(ways.count_bound() == 1U);
    other.reset();
    BOOST_TEST(ways.count_bound() == 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(no_update_follows_the_reply_to_unbind) {
    cles::test::test_link other{node};
    link.ask("BIND car2:pose");
    other.ask("BIND car2:pose");
    ways.bound("car2:pose").binds("{}");
    link.take();
    ways.bound("car2:pose").publishes("{\"x\":1}");
    BOOST_TEST(link.kind("BIND car2:pose lease=0") == "ok");
    drain();
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(unbind_cancels_a_pending_bind) {
    link.ask("BIND car2:pose id=7");
    BOOST_TEST(link.kind("BIND car2:pose lease=0 id=8") == "id=7 cancelled, id=8 ok");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(ways.count_bound() == 0U); // no client is bound any more
    BOOST_TEST(link.take().empty());
}

BOOST_AUTO_TEST_CASE(client_lost_before_the_reply_leaves_nothing) {
    link.ask("BIND car2:pose id=7");
    link.reset();
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(ways.count_bound() == 0U);
    BOOST_TEST(node.counts().handlers_running == 0U);
}

BOOST_AUTO_TEST_CASE(refusal_of_the_other_node_is_forwarded) {
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").refuses(errc::no_task, "car2 has no BIND 'pose'");
    BOOST_TEST(link.sent() == "id=7 no_task");
    BOOST_TEST(link.session().serving().bindings() == 0U);
    link.ask("BIND car2:pose id=8"); // it is bound again
    BOOST_TEST(ways.count_bound() == 1U);
}

BOOST_AUTO_TEST_CASE(unbinding_nothing_is_not_an_error) {
    BOOST_TEST(link.kind("BIND car2:pose lease=0") == "ok");
    BOOST_TEST(link.kind("BIND all:pose lease=0") == "ok");
}

BOOST_AUTO_TEST_CASE(any_and_the_reserved_task_cannot_be_bound) {
    BOOST_TEST(link.kind("BIND any:pose") == "no_target");
    BOOST_TEST(link.kind("BIND car2:cles") == "no_target");
    BOOST_TEST(link.kind("BIND car2:pose hops=0") == "no_target");
    BOOST_TEST(link.kind("BIND car2:pose via=car1") == "no_target");
    BOOST_TEST(ways.count_bound() == 0U);
}

BOOST_AUTO_TEST_CASE(requests_without_an_id_wait_for_it) {
    node.on(verb::pull, "speed", "1");
    link.ask("BIND car2:pose");
    BOOST_TEST(link.ask("PULL self:speed").empty());
    ways.bound("car2:pose").binds("{\"x\":1}");
    BOOST_TEST(link.take() == "{\"x\":1}\n{\"value\":1}\n");
}

BOOST_AUTO_TEST_CASE(unbind_queued_behind_its_bind_unbinds) {
    link.ask("BIND car2:pose");
    link.ask("BIND car2:pose lease=0");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(link.sent() == "ok, ok");
    BOOST_TEST(ways.count_bound() == 0U);
    BOOST_TEST(link.session().serving().bindings() == 0U);
}

BOOST_AUTO_TEST_CASE(binding_by_datagram_ends_with_its_lease) {
    cles::test::test_link source{node, 1200};
    source.ask("BIND car2:pose id=7 lease=1000");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(source.sent() == "id=7 ok");
    node.pass(999ms);
    BOOST_TEST(ways.count_bound() == 1U);
    node.pass(1ms);
    BOOST_TEST(ways.count_bound() == 0U);
}

BOOST_AUTO_TEST_CASE(busy_beyond_the_limit_of_a_link) {
    cles::limits few;
    few.bindings = 1;
    cles::test::test_node small{few};
    const auto routes = std::make_shared<cles::core::request_router>(small.host, ways, 1, [] {});
    cles::test::test_link guest{small};
    guest.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(guest.sent() == "id=7 ok");
    BOOST_TEST(guest.kind("BIND car2:speed id=8") == "id=8 busy");
    guest.reset();
    routes->stop();
}

BOOST_AUTO_TEST_SUITE_END()
