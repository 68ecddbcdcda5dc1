// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/exchange.hpp"
#include "gateway/told/metrics.hpp"
#include "node/base/metrics.hpp"

#include <boost/describe/members.hpp>
#include <boost/describe/modifiers.hpp>
#include <boost/mp11/algorithm.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <set>
#include <string>
#include <string_view>

namespace metrics {
namespace {

using gateway::metrics_format;

template <class T>
void add_members(std::set<std::string>& to, const std::string& before) {
    boost::mp11::mp_for_each<boost::describe::describe_members<T, boost::describe::mod_any_access>>(
        [&](auto member) { to.insert(before + member.name); });
}

std::string prometheus(const std::string& reply) {
    return gateway::metrics_text({{"car1", reply}}, metrics_format::prometheus);
}

} // namespace
} // namespace metrics

BOOST_AUTO_TEST_SUITE(metrics)

// Who counts something says what it is.
BOOST_AUTO_TEST_CASE(each_counter_has_a_help_text) {
    std::set<std::string> counted{"group_failed"};
    metrics::add_members<cles::core::counters>(counted, "");
    metrics::add_members<gateway::gateway_counts>(counted, "gateway.");
    for (const auto verb : cles::verb_names) {
        counted.insert("requests." + std::string{verb});
    }
    std::set<std::string> told;
    for (const auto& row : gateway::metric_table()) {
        told.emplace(row.path);
    }
    for (const auto& name : counted) {
        BOOST_TEST(told.contains(name), "docs/metrics.md has no row for " << name);
    }
    BOOST_TEST(told.size() == gateway::metric_table().size(), "a member has two rows");
}

BOOST_AUTO_TEST_CASE(the_table_is_what_prometheus_expects) {
    std::set<std::string_view> names;
    std::string_view last;
    for (const auto& row : gateway::metric_table()) {
        BOOST_TEST(row.name.starts_with("cles_"), row.name);
        BOOST_TEST(row.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string_view::npos, row.name);
        BOOST_TEST(row.name.ends_with("_total") == row.is_counter(), row.name);
        BOOST_TEST((row.is_counter() || row.kind == "gauge" || row.kind == "summary"), row.name);
        BOOST_TEST(!row.help.empty(), row.name);
        BOOST_TEST(row.help.find('\\') == std::string_view::npos, row.name);
        BOOST_TEST((row.name == last || names.insert(row.name).second), row.name << " is in two places");
        last = row.name;
    }
}

BOOST_AUTO_TEST_CASE(a_node_as_text_for_prometheus) {
    BOOST_TEST(
        metrics::prometheus(R"({"uptime_ms":1500,"requests":{"PULL":3,"PUSH":12345678901234567890},"errors":0})") ==
        "# HELP cles_uptime_seconds Time since the node started\n"
        "# TYPE cles_uptime_seconds gauge\n"
        "cles_uptime_seconds{node=\"car1\"} 1.5\n"
        "# HELP cles_requests_total Requests of programs that were served, by verb\n"
        "# TYPE cles_requests_total counter\n"
        "cles_requests_total{node=\"car1\",verb=\"PULL\"} 3\n"
        "cles_requests_total{node=\"car1\",verb=\"PUSH\"} 12345678901234567890\n"
        "# HELP cles_errors_total Requests of programs that were answered with a failure\n"
        "# TYPE cles_errors_total counter\n"
        "cles_errors_total{node=\"car1\"} 0\n");
}

BOOST_AUTO_TEST_CASE(several_nodes_as_openmetrics) {
    BOOST_TEST(gateway::metrics_text({{"car1", R"({"errors":1})"}, {"car2", R"({"errors":2})"}},
                                     metrics_format::openmetrics) ==
               "# HELP cles_errors Requests of programs that were answered with a failure\n"
               "# TYPE cles_errors counter\n"
               "cles_errors_total{node=\"car1\"} 1\n"
               "cles_errors_total{node=\"car2\"} 2\n"
               "# EOF\n");
    BOOST_TEST(gateway::metrics_text({}, metrics_format::openmetrics) == "# EOF\n");
    BOOST_TEST(gateway::metrics_text({}, metrics_format::prometheus) == "");
}

BOOST_AUTO_TEST_CASE(times_are_seconds) {
    const auto text = metrics::prometheus(R"({"handler_us":{"samples":4,"p50":250,"p99":2000,"p999":2000}})");
    for (const auto* const line :
         {"# TYPE cles_handler_seconds summary\n", "\ncles_handler_seconds_count{node=\"car1\"} 4\n",
          "\ncles_handler_seconds{node=\"car1\",quantile=\"0.99\"} 0.002\n"}) {
        BOOST_TEST(text.find(line) != std::string::npos, text);
    }
}

BOOST_AUTO_TEST_CASE(numbers_that_are_not_in_the_table_are_told_too) {
    BOOST_TEST(metrics::prometheus(R"({"queue":{"depth":7,"is \"full\"":true,"name":"x","list":[1]},"none":null})") ==
               "# HELP cles_value A number of the program's own metrics, or of a later version, by its member\n"
               "# TYPE cles_value gauge\n"
               "cles_value{node=\"car1\",path=\"queue.depth\"} 7\n"
               "cles_value{node=\"car1\",path=\"queue.is \\\"full\\\"\"} 1\n");
}

BOOST_AUTO_TEST_CASE(what_a_node_tells_may_be_anything) {
    for (const auto* const reply : {"", "[]", "{", R"({"errors":})", R"({"errors":1)", "7"}) {
        BOOST_TEST(metrics::prometheus(reply) == "", reply);
    }
    std::string many = "{";
    for (int i = 0; i < 5000; ++i) {
        many += "\"m" + std::to_string(i) + "\":1,";
    }
    const auto text = metrics::prometheus(many + "\"last\":1}");
    BOOST_TEST(std::count(text.begin(), text.end(), '\n') == 1024 + 2);
}

// Each value has a copy of its path, so a long one would be multiplied.
BOOST_AUTO_TEST_CASE(what_is_too_long_is_left_out) {
    const std::string longest(128, 'a');
    BOOST_TEST(metrics::prometheus("{\"" + longest + "\":1}").find("path=\"" + longest + "\"") != std::string::npos);
    BOOST_TEST(metrics::prometheus("{\"a" + longest + "\":1}") == "");
    std::string many = "{\"" + std::string(100'000, 'a') + "\":{";
    for (int i = 0; i < 1024; ++i) {
        many += "\"m" + std::to_string(i) + "\":1,";
    }
    const auto text = metrics::prometheus(many + "\"last\":1},\"errors\":2}");
    BOOST_TEST(text.find("cles_errors_total{node=\"car1\"} 2\n") != std::string::npos);
    BOOST_TEST(text.find("aaa") == std::string::npos);
    BOOST_TEST(metrics::prometheus("{\"m\":1" + std::string(32, '0') + "}") == "");
    BOOST_TEST(gateway::results_of_all("{\"results\":{\"" + std::string(130, 'a') + "\":{},\"car1\":{}}}").size() ==
               1U);
}

BOOST_AUTO_TEST_CASE(the_client_decides_on_the_format) {
    BOOST_TEST((gateway::metrics_format_for("") == metrics_format::prometheus));
    BOOST_TEST((gateway::metrics_format_for("text/plain") == metrics_format::prometheus));
    BOOST_TEST((gateway::metrics_format_for("application/openmetrics-text;version=1.0.0,text/plain;q=0.5") ==
                metrics_format::openmetrics));
}

BOOST_AUTO_TEST_CASE(results_of_all_are_taken_apart) {
    const auto found = gateway::results_of_all(R"({"results":{"car1":{"a":1},"car2":[2]},"errors":{"car3":{}}})");
    BOOST_TEST(found.size() == 2U);
    BOOST_TEST(found.at("car1") == R"({"a":1})");
    BOOST_TEST(found.at("car2") == "[2]");
    BOOST_TEST(gateway::results_of_all("[]").empty());
    BOOST_TEST(gateway::results_of_all(R"({"results":{"car1":})").empty());
}

BOOST_AUTO_TEST_SUITE_END()
