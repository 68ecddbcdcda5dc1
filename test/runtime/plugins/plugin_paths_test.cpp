// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_library.hpp"

#include <boost/test/unit_test.hpp>

#include <string>

using namespace cles::runtime;

namespace plugin_paths {
namespace {

cles::runtime::config from_file(const std::string& file) {
    auto made = default_config("host", 1);
    made.file = file;
    return made;
}

std::string file_of(const std::string& file, const std::string& path) {
    return resolve_plugin_path(from_file(file), {.path = path});
}

} // namespace
} // namespace plugin_paths

BOOST_AUTO_TEST_SUITE(plugin_paths)

BOOST_AUTO_TEST_CASE(a_bare_name_stays_one) { BOOST_TEST(file_of("/etc/cles/clesd.yaml", "libx.so") == "libx.so"); }

BOOST_AUTO_TEST_CASE(an_absolute_path_stays_as_it_is) {
    BOOST_TEST(file_of("/etc/cles/clesd.yaml", "/opt/x/libx.so") == "/opt/x/libx.so");
}

BOOST_AUTO_TEST_CASE(a_relative_path_begins_at_the_configuration_file) {
    BOOST_TEST(file_of("/etc/cles/clesd.yaml", "./libx.so") == "/etc/cles/libx.so");
    BOOST_TEST(file_of("/etc/cles/clesd.yaml", "../x/libx.so") == "/etc/x/libx.so");
    BOOST_TEST(file_of("conf/clesd.yaml", "x/libx.so") == "conf/x/libx.so");
}

// Without a folder it would be searched for elsewhere.
BOOST_AUTO_TEST_CASE(a_path_stays_a_path) {
    BOOST_TEST(file_of("clesd.yaml", "./libx.so") == "./libx.so");
    BOOST_TEST(file_of("./clesd.yaml", "./libx.so") == "./libx.so");
    BOOST_TEST(file_of("", "x/libx.so") == "x/libx.so");
}

BOOST_AUTO_TEST_CASE(configured_folders_come_first) {
    auto setup = from_file("/etc/cles/clesd.yaml");
    setup.plugin_path = {"/opt/plugins", "mine"};
    const auto folders = plugin_search_path(setup);
    BOOST_REQUIRE_GT(folders.size(), 2U);
    BOOST_TEST(folders[0].string() == "/opt/plugins");
    BOOST_TEST(folders[1].string() == "/etc/cles/mine");
    BOOST_TEST(folders[2].is_absolute());
}

BOOST_AUTO_TEST_SUITE_END()
