// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_library.hpp"

#include <boost/test/unit_test.hpp>

#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

namespace plugin_search {
namespace {

using cles::runtime::find_plugin;
using cles::runtime::plugin_error;
namespace fs = std::filesystem;

struct fixture {
    fixture() {
        for (const auto* sub : {"first", "second"}) {
            fs::create_directories(folder / sub);
        }
        std::ofstream{folder / "second" / "a.so"};
    }
    ~fixture() { fs::remove_all(folder); }
    fs::path folder = fs::temp_directory_path() / ("cles_search_" + std::to_string(::getpid()));
};

} // namespace
} // namespace plugin_search

BOOST_FIXTURE_TEST_SUITE(plugin_search, fixture)

BOOST_AUTO_TEST_CASE(a_bare_name_is_looked_for_in_the_folders_in_their_order) {
    BOOST_TEST(find_plugin("a.so", {folder / "first", folder / "second"}) == folder / "second" / "a.so");
    std::ofstream{folder / "first" / "a.so"};
    BOOST_TEST(find_plugin("a.so", {folder / "first", folder / "second"}) == folder / "first" / "a.so");
}

BOOST_AUTO_TEST_CASE(a_path_is_taken_as_it_is) {
    const auto path = (folder / "second" / "a.so").string();
    BOOST_TEST(find_plugin(path, {folder / "first"}) == path);
}

BOOST_AUTO_TEST_CASE(what_is_missing_is_reported_with_the_folders) {
    const auto said = [](const std::string& path, const std::vector<fs::path>& folders) -> std::string {
        try {
            return find_plugin(path, folders).string();
        } catch (const plugin_error& e) {
            return e.what();
        }
    };
    BOOST_TEST(said("b.so", {"/a", "/b"}) == "b.so: there is no such file in /a, /b");
    BOOST_TEST(said("b.so", {}) == "b.so: there are no folders to search for plugins");
    BOOST_TEST(said("./b.so", {"/a"}) == "./b.so: there is no such file");
}

BOOST_AUTO_TEST_CASE(plugins_that_came_along_lie_beside_the_program_or_in_lib) {
    using cles::runtime::default_plugin_folders;
    const auto folders = default_plugin_folders("/usr/local/bin/clesd", "../lib/cles");
    BOOST_TEST(folders.at(0) == "/usr/local/lib/cles");
    BOOST_TEST(folders.at(1) == "/usr/local/plugins");
    BOOST_TEST(default_plugin_folders("/usr/bin/clesd", "../lib/x86_64-linux-gnu/cles").at(0) ==
               "/usr/lib/x86_64-linux-gnu/cles");
    BOOST_TEST(default_plugin_folders("/opt/clesd", "/opt/plugins").at(0) == "/opt/plugins");
    BOOST_TEST(fs::path{cles::runtime::installed_plugins}.filename() == "cles");
}

BOOST_AUTO_TEST_SUITE_END()
