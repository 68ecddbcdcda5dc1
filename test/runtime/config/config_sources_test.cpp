// SPDX-License-Identifier: BSL-1.0
#include "config/config.hpp"
#include "config/config_sources.hpp"
#include "support/temporary_folder.hpp"

#include <boost/test/unit_test.hpp>

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

using namespace cles::runtime;
namespace fs = std::filesystem;

namespace {

struct scratch {
    scratch() {
        sources.host = "host";
        sources.cores = 2;
        sources.variable = [this](const char* name) -> const char* {
            const auto found = variables.find(name);
            return found == variables.end() ? nullptr : found->second.c_str();
        };
        // So that no file of this machine is found.
        variables["CLES_CONFIG"] = write("named.yaml", "node: named\n");
    }

    std::string write(const std::string& name, const std::string& text) const {
        const auto path = folder / name;
        fs::create_directories(path.parent_path());
        std::ofstream{path} << text;
        return path.string();
    }

    cles::test::temporary_folder made{"cles-config"};
    fs::path folder = made.path();
    std::map<std::string, std::string> variables;
    config_sources sources;
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(config_sources, scratch)

BOOST_AUTO_TEST_CASE(the_name_of_the_key_is_the_default_of_the_nodes_name) {
    variables["CLES_CONFIG"] = write("keys.yaml", "workers: 2\n");
    sources.name_of_key = [](const std::string& directory) { return directory == "/keys" ? "car1" : ""; };
    BOOST_TEST(load(sources).node == "host");
    variables["CLES_KEYS"] = "/keys";
    BOOST_TEST(load(sources).node == "car1");
    variables["CLES_KEYS"] = "/unreadable";
    BOOST_TEST(load(sources).node == "host");
    variables["CLES_KEYS"] = "/keys";
    variables["CLES_NODE"] = "car2";
    BOOST_TEST(load(sources).node == "car2");
}

BOOST_AUTO_TEST_CASE(flags_override_the_environment_the_file_and_the_defaults) {
    variables["CLES_CONFIG"] = write("all.yaml", "node: from_file\nqueue: 7\nlog: debug\n");
    BOOST_TEST(load(sources).node == "from_file");
    variables["CLES_NODE"] = "from_environment";
    BOOST_TEST(load(sources).node == "from_environment");
    sources.flags.push_back({"node", {"from_flag"}, "--node"});
    const auto all = load(sources);
    BOOST_TEST(all.node == "from_flag");
    BOOST_TEST(all.queue == 7U);
    BOOST_TEST(all.workers == 2U);
    BOOST_TEST((all.log.level == cles::log_level::debug));
    BOOST_TEST(all.origins.at("node") == "--node");
}

BOOST_AUTO_TEST_CASE(a_file_named_by_flag_overrides_one_named_in_the_environment) {
    BOOST_TEST(load(sources).node == "named");
    sources.file = write("flag.yaml", "node: flagged\n");
    const auto made = load(sources);
    BOOST_TEST(made.node == "flagged");
    BOOST_TEST(made.file == *sources.file);
}

BOOST_AUTO_TEST_CASE(a_named_file_has_to_exist) {
    variables["CLES_CONFIG"] = (folder / "missing.yaml").string();
    BOOST_CHECK_THROW(load(sources), config_error);
}

BOOST_AUTO_TEST_CASE(the_default_locations_in_order) {
    variables["HOME"] = "/home/u";
    BOOST_TEST(
        default_locations(sources.variable) ==
            (std::vector<std::string>{"./clesd.yaml", "/home/u/.config/cles/clesd.yaml", "/etc/cles/clesd.yaml"}),
        boost::test_tools::per_element());
    variables["XDG_CONFIG_HOME"] = "/x";
    BOOST_TEST(default_locations(sources.variable).at(1) == "/x/cles/clesd.yaml");
}

BOOST_AUTO_TEST_CASE(the_first_location_with_a_file_is_used) {
    variables.erase("CLES_CONFIG");
    variables["XDG_CONFIG_HOME"] = folder.string();
    write("cles/clesd.yaml", "node: mine\n");
    BOOST_TEST(load(sources).node == "mine");
}

BOOST_AUTO_TEST_CASE(values_are_checked_together) {
    variables["CLES_LISTEN"] = "tcp://0.0.0.0:1";
    BOOST_CHECK_EXCEPTION(load(sources), config_error, [](const config_error& e) {
        return std::string{e.what()}.starts_with("CLES_LISTEN: listen[0]: 'tcp://0.0.0.0:1' can be reached");
    });
}

BOOST_AUTO_TEST_SUITE_END()
