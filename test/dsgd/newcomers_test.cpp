// SPDX-License-Identifier: BSL-1.0
#include "dsgd/newcomers.hpp"

#include <boost/test/unit_test.hpp>

namespace newcomers {
namespace {

cles::peer peer(const char* node, const char* epoch, const char* tasks = "t",
                cles::peer_state state = cles::peer_state::live) {
    return {.node = node, .epoch = epoch, .state = state, .tasks = tasks};
}

std::string names(const std::vector<cles::peer>& peers) {
    std::string out;
    for (const auto& each : peers) {
        out += each.node + " ";
    }
    return out;
}

} // namespace
} // namespace newcomers

BOOST_AUTO_TEST_SUITE(newcomers)

BOOST_AUTO_TEST_CASE(each_node_is_asked_once) {
    dsgd::newcomers all;
    BOOST_TEST(names(all.among({peer("a", "1"), peer("b", "1")})) == "a b ");
    BOOST_TEST(names(all.among({peer("a", "1"), peer("b", "1"), peer("c", "1")})) == "c ");
    BOOST_TEST(names(all.among({peer("a", "1")})).empty());
}

BOOST_AUTO_TEST_CASE(it_is_asked_again_when_it_is_another_one_or_has_other_tasks) {
    dsgd::newcomers all;
    all.among({peer("a", "1", "t")});
    BOOST_TEST(names(all.among({peer("a", "2", "t")})) == "a ");
    BOOST_TEST(names(all.among({peer("a", "2", "u")})) == "a ");
    BOOST_TEST(names(all.among({peer("a", "2", "u")})).empty());
}

BOOST_AUTO_TEST_CASE(a_member_is_asked_when_it_was_started_again) {
    dsgd::newcomers all;
    all.joined("a", "1");
    all.joined("b", "");
    BOOST_TEST(names(all.among({peer("a", "1", "t"), peer("b", "7")})).empty());
    BOOST_TEST(names(all.among({peer("a", "1", "u"), peer("b", "7", "u")})).empty());
    BOOST_TEST(names(all.among({peer("a", "2"), peer("b", "8")})) == "a b ");
    all.joined("a", "2");
    BOOST_TEST(all.members().at("a") == "2");
    BOOST_TEST(names(all.among({peer("a", "2")})).empty());
    all.left("a");
    BOOST_TEST(!all.members().contains("a"));
}

BOOST_AUTO_TEST_CASE(only_nodes_of_these_names_are_asked) {
    dsgd::newcomers all{{"a", "b"}};
    BOOST_TEST(names(all.among({peer("a", "1"), peer("c", "1")})) == "a ");
}

BOOST_AUTO_TEST_CASE(a_node_that_is_not_live_is_asked_later) {
    dsgd::newcomers all;
    BOOST_TEST(names(all.among({peer("a", "1", "t", cles::peer_state::suspect)})).empty());
    BOOST_TEST(names(all.among({peer("a", "1")})) == "a ");
}

BOOST_AUTO_TEST_SUITE_END()
