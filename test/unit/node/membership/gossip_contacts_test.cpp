// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_contacts.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>

BOOST_AUTO_TEST_SUITE(gossip_contacts)

using namespace std::chrono_literals;
using part = cles::core::gossip_contact::part;

namespace {

const cles::time_point now{1h};

} // namespace

BOOST_AUTO_TEST_CASE(contacts_are_found_by_ticket_name_and_part) {
    cles::core::gossip_contacts all;
    all.add(part::successor, "car1", "tcp://a:1", now).ticket = 7;
    all.add(part::chosen, "car2", "tcp://b:1", now);
    BOOST_TEST(all.find_ticket(7)->node == "car1");
    BOOST_TEST(all.find_ticket(8) == nullptr);
    BOOST_TEST(all.find_node("car2")->url == "tcp://b:1");
    BOOST_TEST(all.find(part::successor)->node == "car1");
    BOOST_TEST(all.find(part::bootstrap) == nullptr);
    BOOST_TEST(all.count(part::chosen) == 1U);
    BOOST_TEST((all.find_node("car2")->next == now));
}

BOOST_AUTO_TEST_CASE(ended_contacts_are_not_found_and_are_removed_together) {
    cles::core::gossip_contacts all;
    all.add(part::chosen, "car1", "tcp://a:1", now).ended = true;
    all.add(part::chosen, "car2", "tcp://b:1", now);
    BOOST_TEST(all.find_node("car1") == nullptr);
    BOOST_TEST(all.count(part::chosen) == 1U);
    const auto ended = all.take_ended();
    BOOST_REQUIRE(ended.size() == 1U);
    BOOST_TEST(ended[0].url == "tcp://a:1");
    BOOST_TEST(all.take_ended().empty());
}

BOOST_AUTO_TEST_CASE(url_of_another_contact_is_not_released) {
    cles::core::gossip_contacts all;
    all.add(part::bootstrap, "car1", "tcp://a:1", now).ended = true;
    all.add(part::chosen, "car1", "tcp://a:1", now);
    BOOST_TEST(all.take_ended().empty());
    all.find_node("car1")->ended = true;
    BOOST_TEST(all.take_ended().size() == 1U);
}

BOOST_AUTO_TEST_CASE(by_name_the_url_of_another_node_is_released) {
    cles::core::gossip_contacts all;
    all.add(part::bootstrap, {}, "tls://a:1", now).ended = true;
    all.add(part::chosen, "car1", "tls://a:1", now);
    BOOST_TEST(all.take_ended(true).size() == 1U);
}

BOOST_AUTO_TEST_CASE(resting_nodes_expire_and_are_bounded) {
    cles::core::gossip_contacts all;
    all.rest("car1", now + 1s);
    BOOST_TEST(all.rests("car1", now));
    BOOST_TEST(!all.rests("car2", now));
    BOOST_TEST(!all.rests("car1", now + 1s));
    for (int i = 0; i < 100; ++i) {
        all.rest("node" + std::to_string(i), now + 2s);
    }
    BOOST_TEST(!all.rests("node99", now));
    all.expire_resting(now + 2s);
    all.rest("node99", now + 3s);
    BOOST_TEST(all.rests("node99", now + 2s));
}

BOOST_AUTO_TEST_SUITE_END()
