// SPDX-License-Identifier: BSL-1.0
// Which files are loaded as plugins, and that exactly the file that was checked is loaded.
#include <cles/plugin_text.hpp>
#include <cles/service.hpp>

#include "plugins/plugin_file.hpp"
#include "plugins/plugin_host.hpp"
#include "plugins/plugin_library.hpp"
#include "plugins/plugin_trial.hpp"
#include "support/temporary_folder.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#ifdef CLES_WITH_SECURITY
#include <cles/security/checked_file.hpp>
#endif

#include <chrono>
#include <filesystem>
#include <fstream>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

namespace plugin_file {
namespace {

namespace fs = std::filesystem;
using namespace cles::runtime;
using namespace std::chrono_literals;
using checked = cles::runtime::plugin_file;

struct fixture {
    fixture() { put("sound", file); }
    fixture(const fixture&) = delete;
    fixture& operator=(const fixture&) = delete;

    // As an installer does it: another file gets the name.
    void put(const std::string& plugin, const fs::path& as) const {
        fs::copy_file(fs::path{MADE_PLUGINS} / (plugin + ".so"), folder / "new");
        fs::permissions(folder / "new", fs::perms{0755});
        fs::rename(folder / "new", as);
    }
    [[nodiscard]] checked open(const std::string& sha256 = {}) const { return {"mine.so", file, rules, sha256}; }

    cles::test::temporary_folder made{"cles-plugin-file"};
    fs::path folder = made.path();
    fs::path file = folder / "mine.so";
    plugin_rules rules{.secured = true, .folders = {folder}};
};

std::string name_of(const checked& file) {
    const auto library = open_library("mine.so", file);
    return std::string{cles::detail::view_of(describe_plugin("mine.so", *library).name)};
}

template <class F>
std::string refusal(F call) {
    try {
        call();
    } catch (const plugin_error& e) {
        return e.key() + ": " + e.what();
    }
    return {};
}

} // namespace
} // namespace plugin_file

BOOST_FIXTURE_TEST_SUITE(plugin_file, fixture)

BOOST_AUTO_TEST_CASE(without_rules_it_is_loaded_by_its_path) {
    rules = {};
    fs::permissions(file, fs::perms{0777});
    const auto opened = open();
    BOOST_TEST(!opened.is_checked());
    BOOST_TEST(opened.loader_path("mine.so") == file);
    BOOST_TEST(name_of(opened) == "sound");
}

BOOST_AUTO_TEST_CASE(the_rules_of_a_configuration) {
    auto setup = default_config("host", 1);
    setup.plugin_path = {"/opt/plugins"};
    BOOST_TEST(!plugin_rules_of(setup).secured);
    setup.security.keys = "/etc/cles/keys";
    BOOST_TEST(plugin_rules_of(setup).secured);
    BOOST_TEST((plugin_rules_of(setup).folders == plugin_search_path(setup)));
}

#ifdef CLES_WITH_SECURITY

BOOST_AUTO_TEST_CASE(the_checked_file_is_loaded) {
    const auto opened = open();
    BOOST_TEST(opened.is_checked());
    BOOST_TEST(opened.path() == file);
    BOOST_TEST(fs::equivalent(opened.loader_path("mine.so"), file));
    BOOST_TEST(name_of(opened) == "sound");
}

BOOST_AUTO_TEST_CASE(a_file_that_is_replaced_after_the_check_is_not_loaded) {
    const auto opened = open();
    put("rough", file);
    BOOST_TEST(name_of(opened) == "sound");
    std::ofstream{folder / "new"} << "no library";
    fs::rename(folder / "new", file);
    BOOST_TEST(name_of(opened) == "sound");
    try_plugin("mine.so", opened, "node", "{}", 10s);
    fs::remove(file);
    BOOST_TEST(name_of(opened) == "sound");
    try_plugin("mine.so", opened, "node", "{}", 10s);
}

BOOST_AUTO_TEST_CASE(nothing_but_the_pinned_file_is_loaded_while_another_takes_its_place) {
    const auto pin = cles::security::checked_file{file.string()}.sha256();
    put("sound", folder / "sound.so");
    put("rough", folder / "rough.so");
    const std::jthread exchanging{[&](const std::stop_token& stopped) {
        for (unsigned i = 0; !stopped.stop_requested(); ++i) {
            fs::create_hard_link(folder / (i % 2 == 0 ? "rough.so" : "sound.so"), folder / "next");
            fs::rename(folder / "next", file);
            fs::remove(folder / "next"); // if both were one file already
        }
    }};
    int loaded = 0;
    int refused = 0;
    for (int i = 0; i < 100'000 && (loaded < 20 || refused < 20); ++i) {
        try {
            const auto opened = open(pin);
            BOOST_REQUIRE(name_of(opened) == "sound");
            ++loaded;
        } catch (const plugin_error& e) {
            BOOST_REQUIRE(e.key() == "sha256");
            ++refused;
        }
    }
    BOOST_TEST(loaded >= 20);
    BOOST_TEST(refused >= 20);
}

// The loader takes a library that it knows by the same name without looking at the file, and numbers of files are used
// again.
BOOST_AUTO_TEST_CASE(files_that_are_loaded_in_turn_are_not_confused) {
    std::vector<std::string> names;
    for (const auto* plugin : {"no_entry", "sound", "rough", "sound", "refuses"}) {
        put(plugin, file);
        try {
            names.push_back(name_of(open()));
        } catch (const plugin_error&) {
            names.emplace_back("none");
        }
    }
    BOOST_TEST((names == std::vector<std::string>{"none", "sound", "rough", "sound", "faulty"}));
}

BOOST_AUTO_TEST_CASE(the_same_file_is_not_loaded_twice_and_another_one_of_its_name_is) {
    boost::asio::io_context io;
    cles::service node{io, {.name = "node"}};
    plugin_host host{{.node = "node", .rules = rules}};
    host.load("mine.so", "{}", node);
    BOOST_TEST(node.request("PULL self:number") == R"({"value":42})");
    fs::create_hard_link(file, folder / "same.so");
    fs::create_symlink("mine.so", folder / "linked.so");
    for (const std::string path : {"mine.so", "same.so", "linked.so"}) {
        BOOST_TEST(refusal([&] { host.load(path, "{}", node); }) == "path: " + path + ": it is already loaded");
    }
    put("rough", file);
    host.load("mine.so", "{}", node);
    BOOST_TEST(host.plugins().size() == 2U);
    put("sound", file); // as after a rebuild
    BOOST_TEST(refusal([&] { host.load("mine.so", "{}", node); }) ==
               "path: mine.so: PULL 'number' is already provided by the plugin 'sound' (mine.so)");
}

BOOST_AUTO_TEST_CASE(a_host_checks_the_pin) {
    const auto pin = cles::security::checked_file{file.string()}.sha256();
    boost::asio::io_context io;
    cles::service node{io, {.name = "node"}};
    plugin_host host{{.node = "node", .rules = {.folders = {folder}}}};
    const std::string other(64, '0');
    BOOST_TEST(refusal([&] { host.load("mine.so", "{}", node, other); }) ==
               "sha256: mine.so: the SHA-256 of " + file.string() + " is " + pin +
                   ", not the configured one: if you know why the file has changed, set sha256 to this");
    host.load("mine.so", "{}", node, pin);
    BOOST_TEST(node.request("PULL self:number") == R"({"value":42})");
}

BOOST_AUTO_TEST_CASE(a_folder_is_not_allowed_by_the_beginning_of_its_name) {
    fs::create_directory(folder / "lib");
    put("sound", folder / "lib" / "mine.so");
    rules.folders = {folder / "li", folder / "library", folder / "lib" / "mine", ""};
    const auto other = refusal([&] { checked("mine.so", folder / "lib" / "mine.so", rules, ""); });
    BOOST_TEST(other.find("add " + (folder / "lib").string() + " to 'plugin_path'") != std::string::npos, other);
    for (const auto& allowed :
         {folder / "lib", folder / "lib" / "", folder, folder / "lib" / ".." / "lib", fs::path{"/"}}) {
        rules.folders = {allowed};
        BOOST_TEST(refusal([&] { checked("mine.so", folder / "lib" / "mine.so", rules, ""); }) == "", allowed);
    }
}

#else

BOOST_AUTO_TEST_CASE(a_pin_is_refused_without_security) {
    rules = {};
    BOOST_TEST(refusal([&] { static_cast<void>(open(std::string(64, '0'))); }) ==
               "sha256: mine.so: this clesd was built without security, so it cannot check a SHA-256");
}

#endif

BOOST_AUTO_TEST_SUITE_END()
