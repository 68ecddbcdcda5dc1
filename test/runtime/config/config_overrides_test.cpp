// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"
#include "config/config_sources.hpp"

#include <boost/test/unit_test.hpp>

#include <map>
#include <string>
#include <vector>

using namespace cles::runtime;

namespace config_overrides {
namespace {

overrides of(const std::map<std::string, std::string>& variables) {
    return from_environment([&](const char* name) -> const char* {
        const auto found = variables.find(name);
        return found == variables.end() ? nullptr : found->second.c_str();
    });
}

std::string refusal(const std::map<std::string, std::string>& variables) {
    auto c = default_config("host", 1);
    try {
        apply_overrides(of(variables), c);
    } catch (const config_error& e) {
        return e.what();
    }
    return "accepted";
}

} // namespace
} // namespace config_overrides

BOOST_AUTO_TEST_SUITE(config_overrides)

BOOST_AUTO_TEST_CASE(every_variable) {
    auto c = default_config("host", 1);
    apply_overrides(of({{"CLES_NODE", "sat1"},
                        {"CLES_LISTEN", "tcp://127.0.0.1:1,udp://127.0.0.1:1"},
                        {"CLES_SEEDS", "tcp://127.0.0.1:2, tcp://127.0.0.1:3,"},
                        {"CLES_MULTICAST", "off"},
                        {"CLES_LOG", "debug,json"}}),
                    c);
    BOOST_TEST(c.node == "sat1");
    BOOST_TEST(c.listen == (std::vector<std::string>{"tcp://127.0.0.1:1", "udp://127.0.0.1:1"}),
               boost::test_tools::per_element());
    BOOST_TEST(c.seeds == (std::vector<std::string>{"tcp://127.0.0.1:2", "tcp://127.0.0.1:3"}),
               boost::test_tools::per_element());
    BOOST_TEST(!c.multicast.is_on());
    BOOST_TEST((c.log == log_config{cles::log_level::debug, log_format::json}));
    BOOST_TEST(c.location_of("listen[1]") == "CLES_LISTEN: listen[1]");
}

BOOST_AUTO_TEST_CASE(empty_variables_are_ignored) {
    const auto none = of({{"CLES_NODE", ""}, {"CLES_SEEDS", ""}});
    BOOST_TEST(none.empty());
}

BOOST_AUTO_TEST_CASE(an_error_names_the_variable) {
    BOOST_TEST(refusal({{"CLES_NODE", "self"}}).starts_with("CLES_NODE: 'self' is not a valid node name"));
    BOOST_TEST(refusal({{"CLES_LISTEN", "tcp://127.0.0.1:1,there"}}).starts_with("CLES_LISTEN: "));
    BOOST_TEST(refusal({{"CLES_SEEDS", "there"}}).starts_with("CLES_SEEDS: "));
    BOOST_TEST(refusal({{"CLES_MULTICAST", "lo,1.1.1.1"}}).starts_with("CLES_MULTICAST: "));
    BOOST_TEST(refusal({{"CLES_LOG", "loud"}}).starts_with("CLES_LOG: 'loud' is not a log setting"));
}

BOOST_AUTO_TEST_CASE(an_override_replaces_the_origin) {
    auto c = default_config("host", 1);
    c.origins = {{"listen", "f:1"}, {"listen[0]", "f:2"}, {"listen[1]", "f:3"}, {"listeners", "f:4"}};
    apply_overrides({{"listen", {"tcp://127.0.0.1:1"}, "--listen"}}, c);
    const std::map<std::string, std::string> left{
        {"listen", "--listen"}, {"listen[0]", "--listen"}, {"listeners", "f:4"}};
    BOOST_TEST((c.origins == left));
}

BOOST_AUTO_TEST_SUITE_END()
