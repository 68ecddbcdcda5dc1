// SPDX-License-Identifier: BSL-1.0
// docs/protocol.md: replies to urgent requests precede those that wait.

#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

namespace inbound_urgent {
namespace {

using cles::verb;

struct fixture {
    fixture() {
        node.on(verb::pull, "map", "{\"large\":1}");
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on_later(verb::delegate, "stop");
        link.session().on_line("PULL car1:map id=1", node.clock.now());
    }
    /// What is sent when this line follows the request for the map.
    std::string with(std::string_view line) { return link.ask(line); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

const std::string map = "id=1 {\"large\":1}\n";

} // namespace
} // namespace inbound_urgent

BOOST_FIXTURE_TEST_SUITE(inbound_urgent, fixture)

BOOST_AUTO_TEST_CASE(the_reply_to_an_urgent_request_precedes_others) {
    BOOST_TEST(with("PULL car1:speed id=2 urgent=yes") == "id=2 {\"v\":3}\n" + map);
}

BOOST_AUTO_TEST_CASE(without_it_replies_keep_their_order) {
    BOOST_TEST(with("PULL car1:speed id=2") == map + "id=2 {\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(a_request_without_id_keeps_its_place) {
    BOOST_TEST(with("PULL car1:speed urgent=yes") == map + "{\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(so_does_its_failure) {
    const auto sent = with("PULL car1:nothing id=2 urgent=yes");
    BOOST_TEST(sent.starts_with("id=2 {\"error\":\"no_task\""));
    BOOST_TEST(sent.ends_with(map));
}

BOOST_AUTO_TEST_CASE(progress_and_result_of_an_urgent_job_keep_their_order_among_themselves) {
    BOOST_TEST(with("DELEGATE car1:stop id=2 urgent=yes progress=yes") == map);
    link.session().on_line("PULL car1:map id=1", node.clock.now());
    node.started.at(0)->call->progress(0.5, "{}");
    node.started.at(0)->call->done("{}");
    BOOST_TEST(link.take() == "id=2 progress=0.5 {}\nid=2 {}\n" + map);
}

BOOST_AUTO_TEST_CASE(a_binding_cannot_be_urgent) {
    node.open("speed");
    BOOST_TEST(with("BIND car1:speed id=2 urgent=yes") == map + "id=2 {}\n");
}

BOOST_AUTO_TEST_CASE(by_datagram_nothing_waits_and_nothing_changes) {
    cles::test::test_link datagrams{node, 1200};
    BOOST_TEST(datagrams.ask("PULL car1:speed id=2 urgent=yes") == "id=2 {\"v\":3}\n");
}

BOOST_AUTO_TEST_SUITE_END()
