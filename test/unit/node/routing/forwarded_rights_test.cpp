// SPDX-License-Identifier: BSL-1.0
#include "support/routing_fixture.hpp"
#include "support/scripted_security.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>

namespace forwarded_rights {
namespace {

struct security_of_fixture {
    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
};

/// The node car1, which forwards for sat1.
struct fixture : security_of_fixture, cles::test::routing_fixture {
    fixture() : routing_fixture(security, "sat1") {}
};

} // namespace
} // namespace forwarded_rights

BOOST_FIXTURE_TEST_SUITE(forwarded_rights, fixture)

using cles::verb;

BOOST_AUTO_TEST_CASE(the_requester_is_stated) {
    link.ask("PULL car2:speed id=7");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1 from=sat1");
    offer("car3", task("PULL", "fuel"));
    link.ask("PULL any:fuel id=8");
    BOOST_TEST(ways.to("car3").text == "PULL car3:fuel hops=7 via=car1 from=sat1");
    link.ask("PULL all:fuel id=9");
    BOOST_TEST(ways.to("car3").text == "PULL car3:fuel hops=7 via=car1 from=sat1");
    link.ask("BIND car2:pose id=10");
    BOOST_TEST(ways.bound("car2:pose").text == "car2:pose hops=7 via=car1 from=sat1");
}

BOOST_AUTO_TEST_CASE(the_requester_of_another_forwarder_is_passed_on) {
    security->forwarders = {"car1", "sat1"};
    link.ask("PULL car2:speed id=7 from=car3");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1 from=car3");
    security->forwarders = {"car1"};
    const auto before = ways.count();
    BOOST_TEST(link.kind("PULL car2:speed id=8 from=car3") == "id=8 denied"); // not as a request of sat1
    BOOST_TEST(ways.count() == before);
}

BOOST_AUTO_TEST_CASE(own_requests_state_none) {
    cles::test::test_link own{node, "car1"};
    own.ask("PULL car2:speed id=7");
    BOOST_TEST(ways.to("car2").text == "PULL car2:speed hops=7 via=car1");
}

BOOST_AUTO_TEST_CASE(a_node_without_the_right_to_forward_does_not) {
    security->forwarders = {};
    BOOST_TEST(link.ask("PULL car2:speed id=7") ==
               "id=7 {\"error\":\"denied\",\"message\":\"car1 may not forward requests of sat1 to car2 "
               "(cles fleet rights car1 --forwards sat1)\"}\n");
    BOOST_TEST(link.kind("BIND car2:pose id=8") == "id=8 denied");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(the_rights_apply_before_it_is_forwarded) {
    security->denied = {"sat1 PULL car2:speed", "sat1 BIND car2:pose"};
    BOOST_TEST(link.kind("PULL car2:speed id=7") == "id=7 denied");
    BOOST_TEST(link.kind("BIND car2:pose id=8") == "id=8 denied");
    BOOST_TEST(ways.count() == 0U);
}

BOOST_AUTO_TEST_CASE(any_chooses_among_permitted_nodes) {
    offer("car2", task("PULL", "speed"));
    offer("car3", task("PULL", "speed"));
    node.on(verb::pull, "speed", "1");
    security->denied = {"sat1 PULL car2:speed", "sat1 PULL car1:speed"};
    for (int i = 0; i < 10; ++i) {
        link.ask("PULL any:speed id=7");
        BOOST_TEST(ways.to("car3").open());
        ways.to("car3").answers("{}");
        BOOST_TEST(link.sent() == "id=7 ok");
    }
    security->denied.insert("sat1 PULL car3:speed");
    BOOST_TEST(link.kind("PULL any:speed id=8") == "id=8 no_target");
}

BOOST_AUTO_TEST_CASE(all_asks_permitted_nodes) {
    offer("car2", task("PULL", "speed"));
    offer("car3", task("PULL", "speed"));
    node.on(verb::pull, "speed", "1");
    security->denied = {"sat1 PULL car2:speed", "sat1 PULL car1:speed"};
    link.ask("PULL all:speed id=7");
    ways.to("car3").answers("{\"v\":3}");
    BOOST_TEST(link.take() == "id=7 {\"results\":{\"car3\":{\"v\":3}},\"errors\":{}}\n");
}

BOOST_AUTO_TEST_CASE(all_binds_permitted_publishers) {
    offer("car2", task("BIND", "pose"));
    offer("car3", task("BIND", "pose"));
    security->denied = {"sat1 BIND car2:pose"};
    link.ask("BIND all:pose id=7");
    ways.bound("car3:pose").binds("{}");
    BOOST_TEST(link.take() == "id=7 {\"results\":{\"car3\":{}},\"errors\":{}}\n");
    BOOST_TEST(ways.count_bound() == 1U);
}

BOOST_AUTO_TEST_SUITE(relayed)

BOOST_AUTO_TEST_CASE(each_requester_has_a_binding_of_its_own) {
    cles::test::test_link other{node, "car3"};
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    other.ask("BIND car2:pose id=7");
    BOOST_TEST(ways.count_bound() == 2U);
    BOOST_TEST(ways.bound("car2:pose").text == "car2:pose hops=7 via=car1 from=car3");
    ways.bound("car2:pose").refuses(cles::errc::denied, "not you");
    BOOST_TEST(link.sent() == "id=7 ok");
    BOOST_TEST(other.sent() == "id=7 denied");
}

BOOST_AUTO_TEST_CASE(links_of_one_requester_share_one) {
    cles::test::test_link other{node, "sat1"};
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    BOOST_TEST(other.kind("BIND car2:pose id=7") == "id=7 ok");
    BOOST_TEST(ways.count_bound() == 1U);
}

BOOST_AUTO_TEST_CASE(it_is_known_when_one_is_no_longer_permitted) {
    link.ask("BIND car2:pose id=7");
    ways.bound("car2:pose").binds("{}");
    offer("car3", task("BIND", "track"));
    link.ask("BIND all:track id=8");
    ways.bound("car3:track").binds("{}");
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->denied = {"sat1 BIND car2:pose"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    security->denied = {"sat1 BIND car3:track"};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    security->denied.clear();
    link.ask("BIND all:track id=9 lease=0");
    link.ask("BIND car2:pose id=10 lease=0");
    BOOST_TEST(ways.count_bound() == 0U);
    security->denied = {"sat1 BIND car2:pose", "sat1 BIND car3:track"};
    BOOST_TEST(link.session().serving().are_bindings_permitted());
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
