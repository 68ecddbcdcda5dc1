// SPDX-License-Identifier: BSL-1.0
#include <cles/run.hpp>
#include <cles/wake_bound.hpp>

#include "client/logging.hpp"
#include "commands.hpp"
#include "context.hpp"
#include "options/addresses.hpp"
#include "options/multicast_option.hpp"
#include "output/exit_code.hpp"
#include "output/failure.hpp"
#include "output/output.hpp"
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
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct serve_command {
    std::string name = "car1";
    std::string pool;
    bool allow_clash = false;
    std::vector<std::string> listen;
    bool insecure = false;
    std::vector<std::string> networks;
    multicast_option multicast;
    double rate = 10;
    int busy_poll_us = 0;
    int real_time = 0;
    std::optional<int> wake_within_us;
};

cles::service_options options_of(const serve_command& wanted, const cles::log_sink& log) {
    cles::service_options options;
    options.name = wanted.name;
    const char* pool = std::getenv("CLES_POOL");
    options.pool = wanted.pool.empty() && pool != nullptr ? pool : wanted.pool;
    options.listen = wanted.listen;
    if (options.listen.empty()) {
        options.listen.emplace_back(default_url);
    }
    for (const auto& where : options.listen) {
        if (where.starts_with("inproc:")) {
            throw usage_error("--listen '" + where + "': nobody outside of this process could reach it");
        }
    }
    options.insecure = wanted.insecure;
    options.networks = wanted.networks;
    options.multicast = wanted.multicast.where();
    options.log = log;
    return options;
}

int serve(const serve_command& wanted, int verbosity) {
    const auto log = log_of_server(verbosity);
    std::optional<cles::wake_bound> awake;
    if (wanted.wake_within_us) {
        awake.emplace(std::chrono::microseconds{*wanted.wake_within_us});
    }
    asio::io_context io{1};
    asio::signal_set signals{io, SIGINT, SIGTERM};
    int ended = exit_code::success;
    play_node* running = nullptr;
    auto options = options_of(wanted, log);
    if (!wanted.allow_clash) {
        options.on_name_taken = [&](std::string_view where) {
            log(cles::log_level::error, "stopping: the node at " + std::string{where} + " had the name '" +
                                            wanted.name + "' first; --name gives another, --allow-clash goes on");
            ended = exit_code::local_failure;
            signals.cancel();
            running->stop();
        };
    }
    play_node node{io, std::move(options), wanted.rate};
    running = &node;

    signals.async_wait([&](boost::system::error_code code, int signal) {
        if (!code) {
            log(cles::log_level::info, signal == SIGINT ? "stopping on SIGINT" : "stopping on SIGTERM");
            node.stop();
        }
    });
    for (const auto& endpoint : node.service().endpoints()) {
        write_output(wanted.name + " listening on " + endpoint + "\n");
    }
    cles::run(io, {.busy_poll = std::chrono::microseconds{wanted.busy_poll_us},
                   .fifo_priority = wanted.real_time,
                   .lock_memory = wanted.real_time != 0});
    return ended;
}

} // namespace

void add_serve(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<serve_command>();
    auto* command = app.add_subcommand("serve", "Run a node to experiment with");
    command->add_option("--name", wanted->name, "What the node is called (default car1)")->type_name("NAME");
    command->add_option("--pool", wanted->pool, "To which pool it belongs; others are not known (default CLES_POOL)")
        ->type_name("NAME");
    command->add_flag("--allow-clash", wanted->allow_clash, "Go on where another live node had its name first");
    command
        ->add_option("-l,--listen", wanted->listen,
                     "Where it listens, may be repeated; port 0: a free one (default " + std::string{default_url} + ")")
        ->type_name("URL")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command->add_option("--rate", wanted->rate, "Localizations published a second; 0: only on PULL (default 10)")
        ->type_name("HZ")
        ->check(CLI::Range(0.0, 1e6).description(""));
    command
        ->add_option("--busy-poll", wanted->busy_poll_us,
                     "Look for work so many microseconds before sleeping: quicker answers for processor time (0)")
        ->type_name("US")
        ->check(CLI::Range(0, 1'000'000).description(""));
    command
        ->add_option("--real-time", wanted->real_time,
                     "Run under SCHED_FIFO with this priority, 1 to 99, and with all memory locked")
        ->type_name("PRIO")
        ->check(CLI::Range(1, 99).description(""));
    command
        ->add_option("--wake-within", wanted->wake_within_us,
                     "Let this host's cores sleep no deeper than they wake from in so many microseconds; 0: not at all "
                     "(it takes /dev/cpu_dma_latency)")
        ->type_name("US")
        ->check(CLI::Range(0, 1'000'000).description(""));
    command->add_flag("--insecure", wanted->insecure,
                      "Allow listening and multicast beyond this host, where anybody may ask for anything");
    command
        ->add_option("--network", wanted->networks,
                     "Hosts that may be sent as much by UDP as they ask for, as in 10.0.0.0/8; may be repeated")
        ->type_name("NETWORK")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    wanted->multicast.add_to(
        *command, "By which interface it is found by its name, and publishes to those that bind by multicast");
    command->footer("Tasks: PULL and BIND localization, PULL echo/..., PUSH and DELEGATE echo, DELEGATE sleep/<ms>,\n"
                    "DELEGATE fail, BIND and UPDATE notice. SIGTERM and Ctrl-C stop it.\n\n"
                    "Examples:\n"
                    "  cles serve\n"
                    "  cles serve --name car2 --listen tcp://127.0.0.1:0 --listen unix:///tmp/car2.sock --rate 50\n"
                    "  cles serve --listen tcp://0.0.0.0 --insecure\n"
                    "  cles serve --listen tcp://127.0.0.1 --listen udp://127.0.0.1\n"
                    "  cles serve --multicast eth0 --insecure");
    command->callback([wanted, &shared] { shared.exit_code = serve(*wanted, shared.verbosity); });
}

} // namespace tool
