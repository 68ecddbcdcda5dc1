// SPDX-License-Identifier: BSL-1.0
#include <cles/wake_bound.hpp>

#include "commands.hpp"
#include "options/addresses.hpp"
#include "options/duration.hpp"
#include "serve/demo_node.hpp"
#include "serve/node_arguments.hpp"
#include "serve/node_host.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <chrono>
#include <memory>
#include <optional>
#include <string>

namespace tool {
namespace {

struct serve_arguments {
    node_arguments node{node_defaults{.name = "car1",
                                      .name_text = "that of the key, otherwise car1",
                                      .url = std::string{default_url},
                                      .secured_url = "tls://0.0.0.0:25370",
                                      .url_text = std::string{default_url} + ", with --keys tls on all interfaces"}};
    double rate = 10;
    std::chrono::microseconds busy_poll{0};
    int real_time = 0;
    std::optional<std::chrono::microseconds> wake_within;
};

int serve(const serve_arguments& args, int verbosity) {
    std::optional<cles::wake_bound> latency_limit;
    if (args.wake_within) {
        latency_limit.emplace(*args.wake_within);
    }
    node_host host{args.node, verbosity};
    demo_node demo{host.node(), args.rate};
    return host.run([&demo] { demo.stop(); },
                    {.busy_poll = args.busy_poll, .fifo_priority = args.real_time, .lock_memory = args.real_time != 0});
}

} // namespace

void add_serve(CLI::App& app, context& shared) {
    auto args = std::make_shared<serve_arguments>();
    auto* command = app.add_subcommand("serve", "Run a node for experiments");
    args->node.add_to(*command);
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
    command->footer("Tasks: PULL and BIND localization, PULL and DELEGATE systemTime/UTC, PULL echo/...,\n"
                    "PUSH and DELEGATE echo, DELEGATE sleep/<ms>, DELEGATE fail, BIND and UPDATE notice. SIGTERM and "
                    "Ctrl-C stop the node.\n\n"
                    "Examples:\n"
                    "  cles serve\n"
                    "  cles serve --name car2 --listen tcp://127.0.0.1:0 --listen unix:///tmp/car2.sock --rate 50\n"
                    "  cles serve --listen tcp://0.0.0.0 --insecure\n"
                    "  cles serve --listen tcp://127.0.0.1 --listen udp://127.0.0.1\n"
                    "  cles serve --multicast eth0 --insecure\n"
                    "  cles serve --keys /var/lib/cles/keys");
    command->callback([args, &shared] { shared.exit_code = serve(*args, shared.verbosity); });
}

} // namespace tool
