// SPDX-License-Identifier: BSL-1.0
#include <cles/version.hpp>

#include "daemon/command_line.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <string>
#include <variant>
#include <vector>

using namespace cles::runtime;

namespace command_line {
namespace {

std::variant<cles::runtime::command_line_options, std::string> parse(std::vector<const char*> words) {
    words.insert(words.begin(), "clesd");
    return parse_command_line(static_cast<int>(words.size()), words.data());
}

const cles::runtime::setting_override& of(const cles::runtime::overrides& flags, const std::string& key) {
    const auto found = std::ranges::find(flags, key, &cles::runtime::setting_override::key);
    BOOST_REQUIRE(found != flags.end());
    return *found;
}

} // namespace
} // namespace command_line

BOOST_AUTO_TEST_SUITE(command_line)

BOOST_AUTO_TEST_CASE(without_flags_nothing_is_set) {
    const auto wanted = std::get<cles::runtime::command_line_options>(parse({}));
    BOOST_TEST(!wanted.config);
    BOOST_TEST(!wanted.check);
    BOOST_TEST(!wanted.print_config);
    BOOST_TEST(wanted.flags.empty());
}

BOOST_AUTO_TEST_CASE(every_flag) {
    const auto wanted = std::get<cles::runtime::command_line_options>(
        parse({"--config", "a.yaml", "--check", "--print-config", "--node", "sat1", "--listen", "tcp://127.0.0.1:1",
               "-l", "udp://127.0.0.1:1", "--seed", "tcp://127.0.0.1:2", "--multicast", "off", "--log", "debug,json"}));
    BOOST_TEST(wanted.config.value() == "a.yaml");
    BOOST_TEST(wanted.check);
    BOOST_TEST(wanted.print_config);
    BOOST_TEST(of(wanted.flags, "node").texts.at(0) == "sat1");
    BOOST_TEST(of(wanted.flags, "node").source == "--node");
    BOOST_TEST(of(wanted.flags, "listen").texts == (std::vector<std::string>{"tcp://127.0.0.1:1", "udp://127.0.0.1:1"}),
               boost::test_tools::per_element());
    BOOST_TEST(of(wanted.flags, "seeds").source == "--seed");
    BOOST_TEST(of(wanted.flags, "multicast").texts.at(0) == "off");
    BOOST_TEST(of(wanted.flags, "log").texts.at(0) == "debug,json");
}

// Those of `cles serve` are accepted too.
BOOST_AUTO_TEST_CASE(other_names_of_flags) {
    const auto wanted = std::get<cles::runtime::command_line_options>(parse({"--name", "sat1", "-k", "keys"}));
    BOOST_TEST(of(wanted.flags, "node").texts.at(0) == "sat1");
    BOOST_TEST(of(wanted.flags, "node").source == "--node");
    BOOST_TEST(of(wanted.flags, "security").texts.at(0) == "keys");
    BOOST_TEST(of(wanted.flags, "security").source == "--keys");
}

BOOST_AUTO_TEST_CASE(help_and_version_are_printed) {
    BOOST_TEST(std::get<std::string>(parse({"--version"})) == "clesd " + std::string{cles::version} + "\n");
    BOOST_TEST(std::get<std::string>(parse({"--help"})).find("--print-config") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(invalid_command_lines_are_refused) {
    BOOST_CHECK_THROW(parse({"--verbose"}), usage_error);
    BOOST_CHECK_THROW(parse({"start"}), usage_error);
    BOOST_CHECK_THROW(parse({"--node"}), usage_error);
}

BOOST_AUTO_TEST_SUITE_END()
