// SPDX-License-Identifier: BSL-1.0
#include "transport/address_race.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace address_race {
namespace {

using boost::asio::ip::address;
using cles::time_point;
using cles::transport::most_addresses;
using namespace std::chrono_literals;
using race = cles::transport::address_race;
using times = cles::transport::probe_times;

const time_point start{1h};

std::vector<address> addresses(const std::vector<std::string>& texts) {
    std::vector<address> all;
    for (const auto& text : texts) {
        all.push_back(boost::asio::ip::make_address(text));
    }
    return all;
}

std::vector<address> order(const std::vector<std::string>& found, const std::optional<address>& preferred = {}) {
    return cles::transport::in_connection_order(addresses(found), preferred);
}

} // namespace
} // namespace address_race

BOOST_AUTO_TEST_SUITE(address_race)

BOOST_AUTO_TEST_CASE(the_next_is_tried_when_the_last_is_silent) {
    race r{3};
    BOOST_TEST((r.next(start) == 0U));
    BOOST_TEST(!r.next(start));
    BOOST_TEST((r.due() == start + 250ms));
    BOOST_TEST(!r.next(start + 249ms));
    BOOST_TEST((r.next(start + 250ms) == 1U));
    BOOST_TEST(!r.next(start + 499ms));
    BOOST_TEST((r.next(start + 510ms) == 2U));
    BOOST_TEST(!r.due());
    BOOST_TEST(!r.next(start + 1h));
}

BOOST_AUTO_TEST_CASE(the_next_is_tried_at_once_when_one_has_failed) {
    race r{2};
    BOOST_TEST((r.next(start) == 0U));
    r.fail(start + 3ms);
    BOOST_TEST((r.due() == start + 3ms));
    BOOST_TEST((r.next(start + 3ms) == 1U));
    BOOST_TEST(!r.is_lost());
    r.fail(start + 4ms);
    BOOST_TEST(r.is_lost());
}

BOOST_AUTO_TEST_CASE(one_that_has_accepted_gets_more_time) {
    race r{2};
    BOOST_TEST((r.next(start) == 0U));
    r.accept(start + 100ms);
    BOOST_TEST(!r.next(start + 1099ms));
    BOOST_TEST((r.next(start + 1100ms) == 1U));
}

BOOST_AUTO_TEST_CASE(one_that_has_accepted_may_still_fail) {
    race r{2};
    BOOST_TEST((r.next(start) == 0U));
    r.accept(start + 100ms);
    r.fail(start + 200ms);
    BOOST_TEST((r.next(start + 200ms) == 1U));
}

BOOST_AUTO_TEST_CASE(families_alternate_beginning_with_the_systems_choice) {
    BOOST_TEST((order({"fd00::1", "fd00::2", "fd00::3", "10.0.0.1"}) ==
                addresses({"fd00::1", "10.0.0.1", "fd00::2", "fd00::3"})));
    BOOST_TEST((order({"10.0.0.1", "10.0.0.2", "fd00::1"}) == addresses({"10.0.0.1", "fd00::1", "10.0.0.2"})));
}

BOOST_AUTO_TEST_CASE(the_preferred_is_the_first_if_the_host_still_has_it) {
    const auto second = boost::asio::ip::make_address("10.0.0.2");
    BOOST_TEST((order({"10.0.0.1", "10.0.0.2"}, second) == addresses({"10.0.0.2", "10.0.0.1"})));
    BOOST_TEST((order({"10.0.0.1", "10.0.0.3"}, second) == addresses({"10.0.0.1", "10.0.0.3"})));
}

BOOST_AUTO_TEST_CASE(each_address_is_tried_once_and_not_too_many) {
    BOOST_TEST((order({"10.0.0.1", "10.0.0.1"}) == addresses({"10.0.0.1"})));
    BOOST_TEST(order({}).empty());
    std::vector<std::string> many;
    for (int i = 0; i < 100; ++i) {
        many.push_back("10.0.0." + std::to_string(i));
    }
    BOOST_TEST(order(many).size() == most_addresses);
}

BOOST_AUTO_TEST_CASE(questions_are_repeated_with_growing_pauses) {
    times t{start};
    BOOST_TEST((t.due() == start + 200ms));
    BOOST_TEST(!t.next(start + 199ms));
    BOOST_TEST(t.next(start + 200ms));
    BOOST_TEST((t.due() == start + 600ms));
    auto now = start;
    for (int i = 0; i < 20; ++i) {
        now = t.due();
        BOOST_TEST(t.next(now));
    }
    BOOST_TEST((t.due() == now + 5s));
}

BOOST_AUTO_TEST_SUITE_END()
