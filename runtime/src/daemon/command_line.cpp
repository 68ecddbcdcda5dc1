// SPDX-License-Identifier: BSL-1.0
#include "daemon/command_line.hpp"

#include <cles/version.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <vector>

namespace cles::runtime {
namespace {

constexpr auto about = "A node that runs plugins, discovers other nodes, and shares its workers with them.";
constexpr auto footer =
    "The configuration is the first of --config, $CLES_CONFIG, ./clesd.yaml, $XDG_CONFIG_HOME/cles/clesd.yaml and\n"
    "/etc/cles/clesd.yaml; without any, defaults are used. Flags override the environment (CLES_NODE,\n"
    "CLES_POOL, CLES_LISTEN, CLES_SEEDS, CLES_MULTICAST, CLES_LOG), which overrides the file.\n\n"
    "SIGTERM and Ctrl-C stop it after its jobs have ended, within the limit 'drain'; a second one stops it at once.\n"
    "SIGHUP reloads 'seeds' and 'log'.\n\n"
    "Exit codes: 0 ok, 1 could not run, 2 usage or configuration error, 3 another node has the name.\n\n"
    "Examples:\n"
    "  clesd                           # with the defaults: a node on loopback, without tasks\n"
    "  clesd --config clesd.yaml --check\n"
    "  clesd --node sat1 --listen tcp://127.0.0.1:25370 --print-config";

template <class T>
void set_override(const CLI::Option* option, const T& value, std::optional<overrides::given<T>>& to) {
    if (option->count() > 0) {
        to = {value, "--" + option->get_lnames().front()};
    }
}

} // namespace

std::variant<command_line_options, std::string> parse_command_line(int argc, const char* const* argv) {
    command_line_options wanted;
    std::string file;
    std::string node;
    std::string pool;
    bool allow_clash = false;
    std::vector<std::string> listen;
    std::vector<std::string> seeds;
    std::string multicast;
    std::string log;

    CLI::App app{about, "clesd"};
    app.footer(footer);
    app.set_version_flag("--version", "clesd " + std::string{cles::version});
    const auto* config_option = app.add_option("-c,--config", file, "The configuration file")->type_name("FILE");
    app.add_flag("--check", wanted.check, "Only check whether the configuration can be used");
    app.add_flag("--print-config", wanted.print_config,
                 "Only print the configuration, and where each value comes from");
    const auto* node_option = app.add_option("--node", node, "The name of the node")->type_name("NAME");
    const auto* pool_option =
        app.add_option("--pool", pool, "The pool that the node belongs to; nodes of other pools are ignored")
            ->type_name("NAME");
    const auto* clash_option =
        app.add_flag("--allow-clash", allow_clash, "Continue if another live node had the name first");
    const auto several = [](CLI::Option* option) {
        return option->type_name("URL")->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    };
    const auto* listen_option =
        several(app.add_option("-l,--listen", listen, "A URL to listen at, may be repeated; port 0: a free port"));
    const auto* seeds_option =
        several(app.add_option("-s,--seed", seeds, "A node to ask for other nodes, may be repeated"));
    const auto* multicast_option =
        app.add_option("-m,--multicast", multicast, "The interfaces on which other nodes are discovered")
            ->type_name("IFACE[,IFACE...][,GROUP[:PORT]]|auto|off");
    const auto* log_option =
        app.add_option("--log", log, "The level and format of the log: debug, info, warning, error; text, json")
            ->type_name("LEVEL[,FORMAT]");
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
        return app.help();
    } catch (const CLI::CallForVersion& asked) {
        return std::string{asked.what()} + "\n";
    } catch (const CLI::ParseError& e) {
        throw usage_error(e.what());
    }
    if (config_option->count() > 0) {
        wanted.config = file;
    }
    set_override(node_option, node, wanted.flags.node);
    set_override(pool_option, pool, wanted.flags.pool);
    set_override(clash_option, allow_clash, wanted.flags.allow_clash);
    set_override(listen_option, listen, wanted.flags.listen);
    set_override(seeds_option, seeds, wanted.flags.seeds);
    set_override(multicast_option, multicast, wanted.flags.multicast);
    set_override(log_option, log, wanted.flags.log);
    return wanted;
}

} // namespace cles::runtime
