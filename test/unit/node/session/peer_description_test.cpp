// SPDX-License-Identifier: BSL-1.0
#include "node/session/peer_description.hpp"

#include <boost/test/unit_test.hpp>

#include <string_view>

BOOST_AUTO_TEST_SUITE(peer_description)

using description = cles::core::peer_description;

BOOST_AUTO_TEST_CASE(what_concerns_the_sender_is_read) {
    const auto found = description::read(
        R"({"node":"car1","version":"9","features":["trace","mark"],"limits":{"depth":3,"line":4096},"tasks":[{}]})");
    BOOST_TEST((found == description{.node = "car1", .marks = true, .line = 4096}));
}

BOOST_AUTO_TEST_CASE(an_older_node_states_no_limits) {
    const auto found = description::read(R"({"node":"car1","features":[]})");
    BOOST_TEST((found == description{.node = "car1"}));
}

BOOST_AUTO_TEST_CASE(what_has_another_form_is_not_stated_and_the_rest_counts) {
    for (const std::string_view odd :
         {R"({"node":7,"limits":[],"features":["mark"]})",
          R"({"node":"a b","limits":{"line":"x"},"features":["mark"]})",
          R"({"node":{},"limits":{"line":-1},"features":[7,"mark"]})", R"({"limits":{"line":{}},"features":["mark"]})",
          R"({"limits":7,"features":["mark",{}]})"}) {
        BOOST_TEST((description::read(odd) == description{.marks = true}), odd);
    }
    BOOST_TEST((description::read("[1]") == description{}));
    BOOST_TEST((description::read(R"({"features":{"mark":1}})") == description{}));
}

// Otherwise a peer could have everything refused that is sent to it, questions whether it lives included.
BOOST_AUTO_TEST_CASE(every_node_reads_lines_of_256_bytes) {
    BOOST_TEST(description::read(R"({"limits":{"line":3}})").line.value() == 256U);
}

BOOST_AUTO_TEST_SUITE_END()
