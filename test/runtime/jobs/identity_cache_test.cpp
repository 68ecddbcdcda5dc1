// SPDX-License-Identifier: BSL-1.0
#include "jobs/identity_cache.hpp"

#include <boost/test/unit_test.hpp>

#include <list>
#include <string>

BOOST_AUTO_TEST_SUITE(identity_cache)

using cles::identity;

const identity somebody{
    .transport = "tcp", .address = "tcp://127.0.0.1:1", .name = "", .uid = std::nullopt, .local = true};

BOOST_AUTO_TEST_CASE(all_jobs_of_a_link_share_one_copy) {
    cles::runtime::identity_cache peers;
    const auto first = peers.copy_of(somebody);
    BOOST_TEST(first.get() != &somebody);
    BOOST_TEST(first->address == somebody.address);
    BOOST_TEST(peers.copy_of(somebody) == first);
}

BOOST_AUTO_TEST_CASE(another_link_at_the_same_address_has_its_own_copy) {
    cles::runtime::identity_cache peers;
    auto place = somebody;
    const auto first = peers.copy_of(place);
    place.address = "tcp://127.0.0.1:2";
    const auto second = peers.copy_of(place);
    BOOST_TEST(first->address == "tcp://127.0.0.1:1"); // its jobs may still run
    BOOST_TEST(second->address == "tcp://127.0.0.1:2");
    place.uid = 7;
    BOOST_TEST(peers.copy_of(place) != second);
}

BOOST_AUTO_TEST_CASE(memory_is_bounded_with_many_links) {
    cles::runtime::identity_cache peers;
    const std::weak_ptr<const identity> first = peers.copy_of(somebody);
    std::list<identity> others(2000, somebody);
    for (const auto& each : others) {
        BOOST_TEST_REQUIRE(peers.copy_of(each)->address == somebody.address);
    }
    BOOST_TEST(first.expired());
}

BOOST_AUTO_TEST_SUITE_END()
