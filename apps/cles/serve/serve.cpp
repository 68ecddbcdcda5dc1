// SPDX-License-Identifier: BSL-1.0
#include <cles/run.hpp>
#include <cles/tracing.hpp>
#include <cles/wake_bound.hpp>

#include "client/logging.hpp"
#include "client/member_key.hpp"
#include "commands.hpp"
#include "options/addresses.hpp"
#include "options/duration.hpp"
#include "options/keys_option.hpp"
#include "output/errors.hpp"
#include "output/terminal.hpp"
#include "serve/demo_node.hpp"

#include <boost/asio/signal_set.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct serve_arguments {
    std::string name;
    keys_option keys;
    std::string pool;
    bool allow_clash = false;
    std::vector<std::string> listen;
    bool insecure = false;
    std::vector<std::string> networks;
    multicast_option multicast;
    double rate = 10;
    std::chrono::microseconds busy_poll{0};
    int real_time = 0;
    std::optional<std::chrono::microseconds> wake_within;
};

cles::service_options options_of(const serve_arguments& args, const cles::log_sink& log) {
    cles::service_options options;
    const auto keys = args.keys.given_directory();
    if (!keys.empty()) {
        use_member_key(options, keys);
    }
    if (!args.name.empty() || keys.empty()) {
        options.name = args.name.empty() ? "car1" : args.name;
    }
    const char* pool = std::getenv("CLES_POOL");
    options.pool = args.pool.empty() && pool != nullptr ? pool : args.pool;
    options.listen = args.listen;
    if (options.listen.empty()) {
        options.listen.emplace_back(keys.empty() ? default_url : "tls://0.0.0.0:25370");
    }
    for (const auto& where : options.listen) {
        if (where.starts_with("inproc:")) {
            throw usage_error("--listen '" + where + "': it cannot be reached from outside this process");
        }
    }
    options.insecure = args.insecure;
    options.networks = args.networks;
    options.multicast = args.multicast.group(!keys.empty());
    options.tracing = cles::tracing();
    options.log = log;
    return options;
}

int serve(const serve_arguments& args, int verbosity) {
    const auto log = make_server_log(verbosity);
    std::optional<cles::wake_bound> latency_limit;
    if (args.wake_within) {
        latency_limit.emplace(*args.wake_within);
    }
    asio::io_context io{1};
    asio::signal_set signals{io, SIGINT, SIGTERM};
    int code = exit_code::success;
    demo_node* running = nullptr;
    auto options = options_of(args, log);
    const auto name = options.name;
    if (!args.allow_clash) {
        options.on_name_taken = [&](std::string_view where) {
            log(cles::log_level::error, "stopping: the node at " + std::string{where} + " had the name '" + name +
                                            "' first; choose another name (--name), or allow it (--allow-clash)");
            code = exit_code::local_failure;
            signals.cancel();
            running->stop();
        };
    }
    demo_node node{io, options, args.rate};
    running = &node;

    signals.async_wait([&](boost::system::error_code failed, int signal) {
        if (!failed) {
            log(cles::log_level::info, signal == SIGINT ? "stopping on SIGINT" : "stopping on SIGTERM");
            node.stop();
        }
    });
    for (const auto& endpoint : node.service().endpoints()) {
        std::string line{name};
        line.append(" listening on ").append(endpoint).push_back('\n');
        write_output(line);
    }
    cles::run(io, {.busy_poll = args.busy_poll, .fifo_priority = args.real_time, .lock_memory = args.real_time != 0});
    return code;
}

} // namespace

void add_serve(CLI::App& app, context& shared) {
    auto args = std::make_shared<serve_arguments>();
    auto* command = app.add_subcommand("serve", "Run a node for experiments");
    command->add_option("--name,--node", args->name, "The name of the node (default: that of the key, otherwise car1)")
        ->type_name("NAME");
    command
        ->add_option("--pool", args->pool, "The pool of the node; nodes of other pools are ignored (default CLES_POOL)")
        ->type_name("NAME");
    command->add_flag("--allow-clash", args->allow_clash, "Continue if another live node had the name first");
    command
        ->add_option("-l,--listen", args->listen,
                     "A URL to listen at; port 0: a free port; may be repeated (default " + std::string{default_url} +
                         ", with --keys tls on all interfaces)")
        ->type_name("URL")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->add_option("--rate", args->rate, "Localizations published per second; 0: only on PULL (default 10)")
        ->type_name("HZ")
        ->check(CLI::Range(0.0, 1e6).description(""));
    command
        ->add_option_function<std::string>(
            "--busy-poll",
            [args = args.get()](const std::string& text) { args->busy_poll = parse_wait("--busy-poll", text); },
            "How long to poll for work before sleeping, 50us or microseconds: faster replies, more processor time "
            "(default 0)")
        ->type_name("TIME");
    command
        ->add_option("--real-time", args->real_time,
                     "Run under SCHED_FIFO with this priority, 1 to 99, with all memory locked")
        ->type_name("PRIO")
        ->check(CLI::Range(1, 99).description(""));
    command
        ->add_option_function<std::string>(
            "--wake-within",
            [args = args.get()](const std::string& text) { args->wake_within = parse_wait("--wake-within", text); },
            "Limit the wake-up latency of the processor to this time, 50us or microseconds; 0: it never sleeps (needs "
            "/dev/cpu_dma_latency)")
        ->type_name("TIME");
    command->add_flag("--insecure", args->insecure,
                      "Allow listening and multicast beyond this host, where anyone may send any request");
    command
        ->add_option("--network", args->networks,
                     "Hosts to which UDP replies are not rate-limited, as in 10.0.0.0/8; may be repeated")
        ->type_name("NETWORK")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    args->keys.add_optional_to(*command, "The key directory of the node, which then authenticates and encrypts");
    args->multicast.add_to(*command, "Interfaces on which it is found by its name, and publishes updates by multicast");
    command->footer("Tasks: PULL and BIND localization, PULL echo/..., PUSH and DELEGATE echo, DELEGATE sleep/<ms>,\n"
                    "DELEGATE fail, BIND and UPDATE notice. SIGTERM and Ctrl-C stop the node.\n\n"
                    "Examples:\n"
                    "  cles serve\n"
                    "  cles serve --name car2 --listen tcp://127.0.0.1:0 --listen unix:///tmp/car2.sock --rate 50\n"
                    "  cles serve --listen tcp://0.0.0.0 --insecure\n"
                    "  cles serve --listen tcp://127.0.0.1 --listen udp://127.0.0.1\n"
                    "  cles serve --multicast eth0 --insecure\n"
                    "  cles serve --keys /etc/cles/keys");
    command->callback([args, &shared] { shared.exit_code = serve(*args, shared.verbosity); });
}

} // namespace tool
