// SPDX-License-Identifier: BSL-1.0
// Libraries that cannot be used: each is reported in one clear line, and affects nothing else.
#include <cles/service.hpp>

#include "plugins/plugin_host.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>

#include <unistd.h>

namespace plugin_host_errors {
namespace {

using cles::runtime::plugin_error;
using cles::runtime::plugin_host;
using namespace std::chrono_literals;

struct fault {
    const char* library;
    const char* said;
};
std::ostream& operator<<(std::ostream& out, const fault& f) { return out << f.library; }

// The message, without the path before it.
constexpr std::array faults{
    fault{"bad_tasks", "PULL 'nothing' has no handler"},
    fault{"bad_types", "BIND 'noun': updates: not a schema of the subset: oneOf: this keyword is not in the subset"},
    fault{"crashes_in_check", "its settings check ends the process by signal 6 (SIGABRT)"},
    fault{"crashes_in_entry", "its entry point ends the process by signal 11 (SIGSEGV)"},
    fault{"describes_nothing", "its entry returns no description"},
    fault{"exits_when_loaded", "its initialization ends the process"},
    fault{"lacks_start", "its description lacks members of version 1.7 of the plugin ABI"},
    fault{"newer_minor", "it needs version 1.14 of the plugin ABI, this host has 1.7"},
    fault{"no_entry", "it is not a plugin: it has no function 'cles_plugin_v1'"},
    fault{"other_version", "it was made for version 2 of the plugin ABI, this host has version 1"},
    fault{"refuses", "the device is on fire"},
    fault{"refuses_setting", "60 at most"},
    fault{"refuses_silently", "it refuses to start without giving a reason"},
    fault{"talks_and_crashes", "its settings check ends the process by signal 6 (SIGABRT): "},
    fault{"talks_and_crashes", "looked at sensor 4999 assertion failed: no sensor is left"},
    fault{"throws_in_entry", "its entry threw: not today"},
    fault{"throws_in_start", "its start threw: no such device"},
    fault{"throws_when_loaded", "thrown by a global object"},
    fault{"too_short", "its description is too short"},
    fault{"undefined_symbol", "cles_test_nobody_has_this"},
    fault{"wrong_major", "it needs version 2.7 of the plugin ABI, this host has 1.7"},
};

struct fixture {
    std::string load(const std::string& path, const std::string& config = "{}") {
        try {
            host.load(path, config, node);
        } catch (const plugin_error& e) {
            return e.what();
        }
        return {};
    }
    std::string refusal_of_sound(const std::string& how) {
        const auto config = R"({"refuse":")" + how + R"("})";
        return load("sound.so", config);
    }
    std::string ask(const std::string& command) { return node.request(command); }

    boost::asio::io_context io;
    cles::service node{io, {.name = "node"}};
    plugin_host host{{.node = "node", .rules = {.folders = {"/nowhere/at/all", MADE_PLUGINS}}}};
};

std::string sound_path() { return std::string{MADE_PLUGINS} + "/sound.so"; }

} // namespace
} // namespace plugin_host_errors

BOOST_FIXTURE_TEST_SUITE(plugin_host_errors, fixture)

BOOST_DATA_TEST_CASE(each_fault_is_reported_in_one_line_that_begins_with_the_path, boost::unit_test::data::make(faults),
                     wrong) {
    fixture f;
    const auto path = std::string{wrong.library} + ".so";
    const auto said = f.load(path);
    BOOST_TEST(said.starts_with(path + ": "), said);
    BOOST_TEST(said.find(wrong.said) != std::string::npos, said);
    BOOST_TEST(said.find('\n') == std::string::npos, said);
    BOOST_TEST(f.host.plugins().empty());
    // The host still works.
    BOOST_TEST(f.load("sound.so") == "");
    BOOST_TEST(f.ask("PULL self:number") == R"({"value":42})");
}

BOOST_AUTO_TEST_CASE(a_library_that_never_ends_loading_is_given_up) {
    plugin_host hasty{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}, .trial = 200ms}};
    BOOST_CHECK_EXCEPTION(hasty.load("hangs_when_loaded.so", "{}", node), plugin_error, [](const plugin_error& e) {
        return std::string{e.what()} == "hangs_when_loaded.so: its initialization does not end";
    });
}

BOOST_AUTO_TEST_CASE(an_entry_point_that_never_returns_is_given_up) {
    plugin_host hasty{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}, .trial = 200ms}};
    BOOST_CHECK_EXCEPTION(hasty.load("hangs_in_entry.so", "{}", node), plugin_error, [](const plugin_error& e) {
        return std::string{e.what()} == "hangs_in_entry.so: its entry point does not end";
    });
}

BOOST_AUTO_TEST_CASE(a_trial_ends_with_its_process_and_not_with_its_output) {
    plugin_host hasty{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}, .trial = 3s}};
    hasty.load("leaves_a_process.so", "{}", node);
    BOOST_TEST(hasty.plugins().size() == 1U);
    // Its output is discarded, and it continues.
    plugin_host hastier{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}, .trial = 200ms}};
    BOOST_CHECK_EXCEPTION(
        hastier.load("closes_output_and_hangs.so", "{}", node), plugin_error, [](const plugin_error& e) {
            return std::string{e.what()} == "closes_output_and_hangs.so: its settings check does not end";
        });
}

BOOST_AUTO_TEST_CASE(the_setting_that_is_to_blame_is_named) {
    const auto blamed = [](const std::string& library, const std::string& config, std::chrono::milliseconds trial) {
        fixture f;
        plugin_host other{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}, .trial = trial}};
        try {
            other.load(library, config, f.node);
        } catch (const plugin_error& e) {
            return e.key();
        }
        return std::string{"loaded"};
    };
    for (const auto trial : {10'000ms, 0ms}) { // by the check in a separate process, and by the start
        BOOST_TEST(blamed("sound.so", R"({"number":"many"})", trial) == "config.number");
        BOOST_TEST(blamed("sound.so", R"({"numer":7})", trial) == "config.numer");
        BOOST_TEST(blamed("sound.so", R"({"number":1001})", trial) == "config.number");
        BOOST_TEST(blamed("sound.so", R"({"refuse":"error"})", trial) == "path");
    }
    BOOST_TEST(blamed("refuses_setting.so", "{}", 10'000ms) == "config.cameras[1].rate");
}

BOOST_AUTO_TEST_CASE(a_file_that_is_not_a_library_is_reported) {
    const auto folder = std::filesystem::temp_directory_path() / ("cles_plugins_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    const auto text = (folder / "text.so").string();
    std::ofstream{text} << "this is no library, but long enough to be read as the head of one, were it one at all\n";
    std::ofstream{folder / "empty.so"};
    BOOST_TEST(load(text).find("it cannot be loaded: ") != std::string::npos);
    BOOST_TEST(load((folder / "empty.so").string()).find("it cannot be loaded: ") != std::string::npos);
    BOOST_TEST(load(folder.string()).find("it cannot be loaded: ") != std::string::npos);
    // Also without the trial.
    plugin_host untried{{.node = "node", .trial = 0ms}};
    BOOST_CHECK_EXCEPTION(untried.load(text, "{}", node), plugin_error, [](const plugin_error& e) {
        return std::string{e.what()}.find("it cannot be loaded: /") != std::string::npos;
    });
    std::filesystem::remove_all(folder);
}

BOOST_AUTO_TEST_CASE(a_missing_file_is_reported_with_the_folders) {
    BOOST_TEST(load("nowhere.so") ==
               std::string{"nowhere.so: there is no such file in /nowhere/at/all, "} + MADE_PLUGINS);
    BOOST_TEST(load("./nowhere.so") == "./nowhere.so: there is no such file");
    BOOST_TEST(load("") == "'': the path is empty");
}

BOOST_AUTO_TEST_CASE(the_same_library_is_not_loaded_twice_by_any_path) {
    BOOST_TEST(load("sound.so") == "");
    BOOST_TEST(load(sound_path()) == sound_path() + ": it is already loaded");
    BOOST_TEST(ask("PULL self:number") == R"({"value":42})");
}

BOOST_AUTO_TEST_CASE(a_task_of_another_plugin_is_reported_with_its_name_and_none_is_registered) {
    // A copy of the library in another file is another plugin.
    const auto copy = std::filesystem::temp_directory_path() / ("cles_sound_" + std::to_string(::getpid()) + ".so");
    std::filesystem::copy_file(sound_path(), copy, std::filesystem::copy_options::overwrite_existing);
    BOOST_TEST(load("sound.so") == "");
    BOOST_TEST(load(copy.string(), R"({"number":7})") ==
               copy.string() + ": PULL 'number' is already provided by the plugin 'sound' (sound.so)");
    BOOST_TEST(ask("PULL self:number") == R"({"value":42})");
    std::filesystem::remove(copy);
}

BOOST_AUTO_TEST_CASE(a_task_that_the_service_has_is_reported) {
    node.on_pull("number", [] { return 1; });
    BOOST_TEST(load("sound.so").find("PULL 'number'") != std::string::npos);
    BOOST_TEST(ask("PULL self:number") == R"({"value":1})");
    BOOST_TEST(host.plugins().empty());
}

BOOST_AUTO_TEST_CASE(a_cpp_plugin_reports_what_its_function_threw) {
    const auto said = [](const std::string& how) {
        fixture f;
        return f.refusal_of_sound(how);
    };
    BOOST_TEST(said("error") == "sound.so: no device there");
    BOOST_TEST(said("anything") == "sound.so: it threw something that is not an exception");
    BOOST_TEST(said("twice") == "sound.so: PULL 'number' is added twice");
    BOOST_TEST(said("name").find("'not a name' is not a task's name") != std::string::npos);
    BOOST_TEST(said("coroutine").find("PULL 'later' is a coroutine, for which a plugin has no executor") !=
               std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_refused_plugin_may_be_loaded_after_it_was_mended) {
    BOOST_TEST(refusal_of_sound("error") != "");
    plugin_host other{{.node = "node", .rules = {.folders = {MADE_PLUGINS}}}};
    other.load("sound.so", "{}", node);
    BOOST_TEST(ask("PULL self:number") == R"({"value":42})");
}

BOOST_AUTO_TEST_CASE(settings_that_do_not_fit_are_reported) {
    const auto said = [](const std::string& config) {
        fixture f;
        return f.load("sound.so", config);
    };
    BOOST_TEST(said(R"({"number":"many"})").find("its configuration is invalid: number: expected") !=
               std::string::npos);
    BOOST_TEST(said(R"({"numer":7})") == "sound.so: it has no setting 'numer'");
    BOOST_TEST(said(R"({"number":7})") == "");
}

BOOST_AUTO_TEST_SUITE_END()
