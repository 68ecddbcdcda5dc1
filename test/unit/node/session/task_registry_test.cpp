// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/session/task_execution.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <vector>

namespace task_registry {
namespace {

using cles::errc;
using cles::verb;

} // namespace
} // namespace task_registry

BOOST_AUTO_TEST_SUITE(task_registry)

BOOST_AUTO_TEST_CASE(a_task_is_found_by_its_verb_and_name) {
    cles::core::task_registry tasks;
    tasks.add(verb::pull, "speed", {.info = {.description = "in m/s"}});
    BOOST_REQUIRE(tasks.find(verb::pull, "speed") != nullptr);
    BOOST_TEST(tasks.find(verb::pull, "speed")->info.description == "in m/s");
    BOOST_TEST(tasks.find(verb::push, "speed") == nullptr);
    BOOST_TEST(tasks.find(verb::pull, "Speed") == nullptr); // names are case-sensitive
    BOOST_TEST(tasks.find(verb::pull, "spee") == nullptr);
}

BOOST_AUTO_TEST_CASE(a_verb_and_task_are_registered_once) {
    cles::core::task_registry tasks;
    tasks.add(verb::pull, "speed", {});
    tasks.add(verb::push, "speed", {});
    BOOST_CHECK_EXCEPTION(tasks.add(verb::pull, "speed", {}), cles::error,
                          [](const cles::error& e) { return e.code() == errc::already_registered; });
}

BOOST_AUTO_TEST_CASE(a_removed_task_is_not_found_and_may_be_added_again) {
    cles::core::task_registry tasks;
    tasks.add(verb::pull, "speed", {.info = {.description = "in m/s"}});
    tasks.add(verb::push, "speed", {});
    BOOST_TEST(!tasks.remove(verb::delegate, "speed"));
    BOOST_TEST(!tasks.remove(verb::pull, "spee"));
    const auto removed = tasks.remove(verb::pull, "speed");
    BOOST_REQUIRE(removed);
    BOOST_TEST(removed->info.description == "in m/s");
    BOOST_TEST(tasks.find(verb::pull, "speed") == nullptr);
    BOOST_TEST(tasks.find(verb::push, "speed") != nullptr);
    BOOST_TEST(!tasks.remove(verb::pull, "speed"));
    tasks.add(verb::pull, "speed", {});
    tasks.remove(verb::pull, "speed");
    tasks.remove(verb::push, "speed");
    BOOST_TEST(tasks.tasks().empty());
}

BOOST_AUTO_TEST_CASE(a_task_has_a_valid_name_other_than_cles) {
    cles::core::task_registry tasks;
    for (const std::string bad : {"", "a b", "a/b", "a:b", "cles", "\xC3\xA4"}) {
        BOOST_CHECK_EXCEPTION(tasks.add(verb::pull, bad, {}), cles::error,
                              [](const cles::error& e) { return e.code() == errc::invalid_name; });
    }
    BOOST_CHECK_THROW(tasks.add(verb::pull, std::string(65, 'a'), {}), cles::error);
    tasks.add(verb::pull, std::string(64, 'a'), {});
    tasks.add(verb::pull, "self", {}); // reserved as a target only
    tasks.add(verb::pull, "Cles", {});
}

BOOST_AUTO_TEST_CASE(bind_and_update_open_a_task_for_bind) {
    cles::core::task_registry tasks;
    tasks.add(verb::pull, "a", {});
    tasks.add(verb::bind, "b", {});
    tasks.add(verb::update, "c", {});
    BOOST_TEST(!tasks.can_bind("a"));
    BOOST_TEST(tasks.can_bind("b"));
    BOOST_TEST(tasks.can_bind("c"));
    BOOST_TEST(!tasks.can_bind("d"));
}

BOOST_AUTO_TEST_CASE(tasks_are_listed_in_the_order_of_their_names) {
    cles::core::task_registry tasks;
    for (const std::string name : {"c", "a", "b"}) {
        tasks.add(verb::pull, name, {});
    }
    std::vector<std::string> names;
    for (const auto& [name, handlers] : tasks.tasks()) {
        names.push_back(name);
    }
    const std::vector<std::string> expected{"a", "b", "c"};
    BOOST_TEST(names == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
