// SPDX-License-Identifier: BSL-1.0
#include "core/task_list.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(task_list)

using cles::verb;
using cles::core::read_task_list;

BOOST_AUTO_TEST_CASE(it_is_read_out_of_a_description) {
    const auto list = read_task_list(
        R"({"node":"car1","version":"1","tasks":[{"verb":"PULL","task":"speed","description":"m/s","parameters":["a"]},)"
        R"({"verb":"DELEGATE","task":"work","idempotent":true,"new":{"x":[1]}}],"load":{"queued":0}})",
        "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.size() == 2U);
    BOOST_REQUIRE(list->find(verb::pull, "speed") != nullptr);
    BOOST_TEST(!list->find(verb::pull, "speed")->idempotent);
    BOOST_REQUIRE(list->find(verb::delegate, "work") != nullptr);
    BOOST_TEST(list->find(verb::delegate, "work")->idempotent);
    BOOST_TEST(list->find(verb::push, "speed") == nullptr);
}

BOOST_AUTO_TEST_CASE(what_is_no_task_is_passed_over) {
    const auto list = read_task_list(
        R"({"node":"car1","tasks":[{"verb":"FETCH","task":"speed"},{"task":"speed"},{"verb":"PULL"},{"verb":"PULL","task":"a b"},{}]})",
        "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.empty());
}

BOOST_AUTO_TEST_CASE(what_is_no_description_is_none) {
    for (const std::string_view text :
         {"", "[]", "{}", "{\"node\":\"car2\",\"tasks\":[]}", "{\"node\":\"car1\",\"tasks\":{}}",
          "{\"node\":\"car1\",\"tasks\":[1]}", "{\"node\":\"car1\",\"tasks\":[{\"verb\":1}]}", "{\"node\":\"car1\""}) {
        BOOST_TEST(!read_task_list(text, "car1"), text);
    }
}

BOOST_AUTO_TEST_CASE(a_node_that_offers_too_much_is_cut_short) {
    std::string text = R"({"node":"car1","tasks":[)";
    for (int i = 0; i < 5000; ++i) {
        text += std::string{i == 0 ? "" : ","} + R"({"verb":"PULL","task":"t)" + std::to_string(i) + "\"}";
    }
    const auto list = read_task_list(text + "]}", "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.size() == cles::core::most_tasks_of_a_node);
}

BOOST_AUTO_TEST_SUITE_END()
