// SPDX-License-Identifier: BSL-1.0
#include "node/routing/service_registry.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <string_view>

BOOST_AUTO_TEST_SUITE(task_list)

using cles::verb;
using cles::core::read_task_list;

namespace {

const cles::core::task_list::entry* find(const cles::core::task_list& in, cles::verb verb, std::string_view task) {
    const auto found = std::find_if(in.entries.begin(), in.entries.end(),
                                    [&](const auto& e) { return e.verb == verb && e.task == task; });
    return found == in.entries.end() ? nullptr : &*found;
}

} // namespace

BOOST_AUTO_TEST_CASE(is_read_from_a_description) {
    const auto list = read_task_list(
        R"({"node":"car1","version":"1","tasks":[{"verb":"PULL","task":"speed","description":"m/s","parameters":["a"]},)"
        R"({"verb":"DELEGATE","task":"work","idempotent":true,"new":{"x":[1]}}],"load":{"queued":0}})",
        "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.size() == 2U);
    BOOST_REQUIRE(find(*list, verb::pull, "speed") != nullptr);
    BOOST_TEST(!find(*list, verb::pull, "speed")->idempotent);
    BOOST_REQUIRE(find(*list, verb::delegate, "work") != nullptr);
    BOOST_TEST(find(*list, verb::delegate, "work")->idempotent);
    BOOST_TEST(find(*list, verb::push, "speed") == nullptr);
}

BOOST_AUTO_TEST_CASE(entries_that_are_not_tasks_are_skipped) {
    const auto list = read_task_list(
        R"({"node":"car1","tasks":[{"verb":"FETCH","task":"speed"},{"task":"speed"},{"verb":"PULL"},{"verb":"PULL","task":"a b"},{}]})",
        "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.empty());
}

BOOST_AUTO_TEST_CASE(invalid_description_has_no_list) {
    for (const std::string_view text :
         {"", "[]", "{}", "{\"node\":\"car2\",\"tasks\":[]}", "{\"node\":\"car1\",\"tasks\":{}}",
          "{\"node\":\"car1\",\"tasks\":null}", "{\"node\":\"car1\",\"tasks\":[1]}",
          "{\"node\":\"car1\",\"tasks\":[{\"verb\":1}]}", "{\"node\":\"car1\""}) {
        BOOST_TEST(!read_task_list(text, "car1"), text);
    }
}

BOOST_AUTO_TEST_CASE(number_of_tasks_is_bounded) {
    std::string text = R"({"node":"car1","tasks":[)";
    for (int i = 0; i < 5000; ++i) {
        text += std::string{i == 0 ? "" : ","} + R"({"verb":"PULL","task":"t)" + std::to_string(i) + "\"}";
    }
    const auto list = read_task_list(text + "]}", "car1");
    BOOST_REQUIRE(list);
    BOOST_TEST(list->entries.size() == cles::core::max_tasks_of_a_node);
}

BOOST_AUTO_TEST_SUITE_END()
