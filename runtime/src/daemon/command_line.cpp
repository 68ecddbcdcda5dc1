// SPDX-License-Identifier: BSL-1.0
#include "daemon/command_line.hpp"

#include <cles/version.hpp>

#include "output/help_formatter.hpp"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <memory>
#include <utility>

namespace cles::runtime {
namespace {

constexpr auto about = "A node that runs plugins, discovers other nodes, and shares its workers with them.";
constexpr auto footer =
    "The configuration is the first of --config, $CLES_CONFIG, ./clesd.yaml, $XDG_CONFIG_HOME/cles/clesd.yaml and\n"
    "/etc/cles/clesd.yaml; without any, defaults are used. Flags override the environment (CLES_NODE,\n"
    "CLES_POOL, CLES_LISTEN, CLES_SEEDS, CLES_MULTICAST, CLES_KEYS, CLES_LOG), which overrides the file.\n\n"
    "SIGTERM and Ctrl-C stop it after its jobs have ended, within the limit 'drain'; a second one stops it at once.\n"
    "SIGHUP reloads 'seeds' and 'log', and starts isolated plugins again that were withdrawn.\n\n"
    "Exit codes: 0 ok, 1 could not run, 2 usage or configuration error, 3 another node has the name.\n\n"
    "Examples:\n"
    "  clesd                           # with the defaults: a node on loopback, without tasks\n"
    "  clesd --config clesd.yaml --check\n"
    "  clesd --node sat1 --listen tcp://127.0.0.1:25370 --print-config\n"
    "  clesd --keys /var/lib/cles/keys";

// "--listen" of "-l,--listen"
std::string last_name_of(const std::string& names) { return names.substr(names.rfind("--")); }

} // namespace

std::variant<command_line_options, std::string> parse_command_line(int argc, const char* const* argv) {
    command_line_options wanted;
    bool allow_clash = false;
    CLI::App app{about, "clesd"};
    app.formatter(std::make_shared<tool::help_formatter>());
    app.footer(footer);
    app.set_version_flag("--version", "clesd " + std::string{cles::version});
    // Overrides a setting of the file.
    const auto add_setting = [&](const char* key, const std::string& names, const char* type, const char* text) {
        auto record = [&wanted, key, source = last_name_of(names)](const CLI::results_t& texts) {
            wanted.flags.push_back({key, texts, source});
            return true;
        };
        return app.add_option(names, std::move(record), text)->type_name(type);
    };
    constexpr auto take_all = CLI::MultiOptionPolicy::TakeAll;

    app.add_option(
           "-c,--config",
           [&](const CLI::results_t& texts) {
               wanted.config = texts.front();
               return true;
           },
           "The configuration file")
        ->type_name("FILE");
    app.add_flag("--check", wanted.check, "Only check whether it could start now with the configuration");
    app.add_flag("--print-config", wanted.print_config,
                 "Only print the configuration, and where each value comes from");
    add_setting("node", "--name,--node", "NAME", "The name of the node");
    add_setting("pool", "--pool", "NAME", "The pool that the node belongs to; nodes of other pools are ignored");
    const auto* clash_option =
        app.add_flag("--allow-clash", allow_clash, "Continue if another live node had the name first");
    add_setting("listen", "-l,--listen", "URL", "A URL to listen at, may be repeated; port 0: a free port")
        ->multi_option_policy(take_all);
    add_setting("seeds", "-s,--seed", "URL", "A node to ask for other nodes, may be repeated")
        ->multi_option_policy(take_all);
    add_setting("multicast", "-m,--multicast", "IFACE[,IFACE...][,GROUP[:PORT]]|auto|off",
                "The interfaces on which other nodes are discovered");
    add_setting("security", "-k,--keys", "DIR", "The node's key directory: authenticates and encrypts");
    add_setting("log", "--log", "LEVEL[,FORMAT]",
                "The level and format of the log: debug, info, warning, error; text, json");
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
        return app.help();
    } catch (const CLI::CallForVersion& asked) {
        return std::string{asked.what()} + "\n";
    } catch (const CLI::ParseError& e) {
        throw usage_error(e.what());
    }
    if (clash_option->count() > 0) {
        wanted.flags.push_back({"allow_clash", {allow_clash ? "true" : "false"}, "--allow-clash"});
    }
    return wanted;
}

} // namespace cles::runtime
