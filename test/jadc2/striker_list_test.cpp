// SPDX-License-Identifier: BSL-1.0
#include "jadc2/striker_list.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace striker_list {
namespace {

using names = std::vector<std::string>;

cles::peer peer(const std::string& node, const std::string& tasks = "t") {
    cles::peer out;
    out.node = node;
    out.epoch = "e";
    out.tasks = tasks;
    return out;
}

const jadc2::node_description strikes{
    .tasks = {{.verb = "PULL", .task = "strike"}, {.verb = "DELEGATE", .task = "strike"}}};
const jadc2::node_description tells{
    .tasks = {{.verb = "PULL", .task = "strike"}, {.verb = "DELEGATE", .task = "other"}}};

} // namespace
} // namespace striker_list

BOOST_AUTO_TEST_SUITE(striker_list)

BOOST_AUTO_TEST_CASE(only_nodes_that_offer_it_are_candidates) {
    jadc2::striker_list all;
    BOOST_TEST(all.update({peer("a"), peer("b"), peer("c")}, 0) == (names{"a", "b", "c"}),
               boost::test_tools::per_element());
    all.described("a", strikes);
    all.described("b", tells);
    BOOST_TEST(all.candidates(0) == names{"a"}, boost::test_tools::per_element());
    all.described("nobody", strikes);
    BOOST_TEST(all.candidates(0) == names{"a"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_description_is_wanted_once_and_when_the_tasks_change) {
    jadc2::striker_list all;
    all.update({peer("a")}, 100);
    BOOST_TEST(all.update({peer("a")}, 100).empty());
    all.failed("a", 100);
    BOOST_TEST(all.update({peer("a")}, 100.9).empty()); // one that refuses is not asked all the time
    BOOST_TEST(all.update({peer("a")}, 101).size() == 1U);
    all.failed("a", 101);
    BOOST_TEST(all.update({peer("a", "u")}, 101).size() == 1U);
    BOOST_TEST(all.update({peer("a", "u")}, 200).empty());
}

BOOST_AUTO_TEST_CASE(one_that_is_gone_or_silent_is_none) {
    jadc2::striker_list all;
    all.update({peer("a"), peer("b"), peer("c")}, 0);
    for (const char* node : {"a", "b", "c"}) {
        all.described(node, strikes);
    }
    auto silent = peer("b");
    silent.state = cles::peer_state::suspect;
    auto out_of_reach = peer("c");
    out_of_reach.hops = 0;
    all.update({silent, out_of_reach}, 0);
    BOOST_TEST(all.candidates(0).empty());
}

BOOST_AUTO_TEST_CASE(orders_are_shared_and_one_that_was_not_reached_is_last) {
    jadc2::striker_list all;
    all.update({peer("a"), peer("b"), peer("c")}, 0);
    for (const char* node : {"a", "b", "c"}) {
        all.described(node, strikes);
    }
    all.gets_order("a");
    BOOST_TEST(all.candidates(10) == (names{"b", "c", "a"}), boost::test_tools::per_element());
    all.avoid("b", 10);
    BOOST_TEST(all.candidates(14.9) == (names{"c", "a", "b"}), boost::test_tools::per_element());
    BOOST_TEST(all.candidates(15) == (names{"b", "c", "a"}), boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
