// SPDX-License-Identifier: BSL-1.0
// The tasks of example 14 reply identically in a service, a test and a plugin.
#include <cles/service.hpp>

#include "../../apps/examples/three_homes/odometer.hpp"
#include "plugins/plugin_host.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <string>
#include <vector>

namespace three_homes {
namespace {

constexpr std::array commands{R"(PUSH self:drive {"km":2})", R"(DELEGATE self:there_and_back {"km":3})",
                              R"(PUSH self:drive {"km":1})", R"(PUSH self:drive {"miles":1})",
                              R"(DELEGATE self:there_and_back [])"};

std::vector<std::string> answers_of(cles::service& node) {
    std::vector<std::string> out;
    for (const auto* command : commands) {
        try {
            out.push_back(node.request(command));
        } catch (const cles::error& e) {
            out.emplace_back(e.what());
        }
    }
    return out;
}

} // namespace
} // namespace three_homes

BOOST_AUTO_TEST_SUITE(three_homes)

BOOST_AUTO_TEST_CASE(an_application_a_test_and_a_plugin_answer_alike) {
    boost::asio::io_context io;
    cles::service application{io, {.name = "node"}};
    register_odometer(application);

    boost::asio::io_context other;
    cles::service daemon{other, {.name = "node"}};
    cles::runtime::plugin_host host{{.node = "node"}};
    host.load(THREE_HOMES_PLUGIN, "{}", daemon);

    const auto here = answers_of(application);
    const auto there = answers_of(daemon);
    BOOST_TEST(here == there, boost::test_tools::per_element());
    BOOST_TEST(here.at(1) == R"({"value":6})");
    BOOST_TEST(here.at(2) == R"({"value":6})");
}

BOOST_AUTO_TEST_CASE(settings_for_a_plugin_without_any_are_reported) {
    boost::asio::io_context io;
    cles::service daemon{io, {.name = "node"}};
    cles::runtime::plugin_host host{{.node = "node"}};
    BOOST_CHECK_EXCEPTION(
        host.load(THREE_HOMES_PLUGIN, R"({"km":7})", daemon), cles::runtime::plugin_error,
        [](const auto& e) { return std::string{e.what()}.ends_with(": it has no settings, but was given some"); });
}

BOOST_AUTO_TEST_SUITE_END()
