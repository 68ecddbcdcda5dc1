// SPDX-License-Identifier: BSL-1.0
#include "bench.hpp"

#include <cles/convert.hpp>

#include "bench_options.hpp"
#include "bench_run.hpp"
#include "diagnostics.hpp"
#include "duration.hpp"
#include "exit_code.hpp"
#include "failure.hpp"
#include "output.hpp"
#include "perf/pinning.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace tool {
namespace {

constexpr const char* description =
    "Measure PULL of a localization packet against a hand-written exchange of packed structs over\n"
    "blocking TCP sockets, both in one run, in turn, each server in a process of its own on another\n"
    "core. With --updates, measure BIND and UPDATE instead; with --stress, the steadiness of PULL.";

constexpr const char* examples = "Examples:\n"
                                 "  cles bench\n"
                                 "  cles bench --transport unix\n"
                                 "  cles bench --in-flight 64 --style callback -o json\n"
                                 "  cles bench --busy-poll 50\n"
                                 "  cles bench --stress\n"
                                 "  cles bench --against tcp://10.0.0.2\n"
                                 "  cles bench --updates --binders 8\n";

constexpr std::size_t most_in_flight = 4096;
constexpr std::size_t most_binders = 1024;
constexpr int most_busy_poll_us = 1'000'000;

const std::map<std::string, carrier> carriers{
    {"tcp", carrier::tcp}, {"udp", carrier::udp}, {"unix", carrier::unix_socket}, {"inproc", carrier::inproc}};
const std::map<std::string, cles::perf::handler_style> styles{{"coroutine", cles::perf::handler_style::coroutine},
                                                              {"callback", cles::perf::handler_style::callback}};

template <class Map>
std::vector<std::string> keys_of(const Map& choices) {
    std::vector<std::string> keys;
    keys.reserve(choices.size());
    for (const auto& choice : choices) {
        keys.push_back(choice.first);
    }
    return keys;
}

struct arguments {
    bench_options options{};
    std::string transport = "tcp";
    std::string style = "coroutine";
    std::string duration{};
    std::string form = "table";
    bool updates = false;
    bool stress = false;
    int busy_poll_us = 0;
};

/// What CLI11 cannot tell from one option alone.
void check(CLI::App& command, arguments& given) {
    given.options.transport = carriers.at(given.transport);
    given.options.style = styles.at(given.style);
    given.options.how.busy_poll = std::chrono::microseconds{given.busy_poll_us};
    const auto refuse = [&](const char* option, const std::string& why) {
        if (command.count(option) != 0) {
            throw usage_error(std::string{option} + " " + why);
        }
    };
    if (given.stress) {
        for (const char* option : {"--updates", "--against", "--binders", "--keep"}) {
            refuse(option, "is not for --stress");
        }
        if (given.options.transport == carrier::inproc) {
            throw usage_error("--stress goes from one process to another: --transport tcp or unix");
        }
    } else if (given.updates) {
        for (const char* option : {"--in-flight", "--against", "--duration"}) {
            refuse(option, "is not for --updates");
        }
        if (given.options.transport == carrier::inproc) {
            throw usage_error("--updates goes from one process to another: --transport tcp or unix");
        }
        if (given.options.transport == carrier::udp) {
            throw usage_error("--updates counts every update, and UDP may lose some: --transport tcp or unix");
        }
    } else {
        for (const char* option : {"--binders", "--keep"}) {
            refuse(option, "is for --updates");
        }
    }
    if (!given.options.against.empty()) {
        refuse("--transport", "is told by the URL of --against");
    }
    if (!given.duration.empty()) {
        given.options.duration = parse_positive_duration(given.duration);
    }
}

void run(CLI::App& command, arguments& given) {
    check(command, given);
    if (given.options.against.empty() && given.options.transport != carrier::inproc && !given.options.one_core &&
        !cles::perf::place_ends().apart()) {
        note("there is one core only: both ends share it, and the figures say little");
    }
    const bool json = given.form == "json";
    if (given.stress) {
        const auto report = bench_stress(given.options);
        write_output(json ? cles::to_json(report) + "\n" : table_of(report));
    } else if (given.updates) {
        const auto report = bench_updates(given.options);
        write_output(json ? cles::to_json(report) + "\n" : table_of(report));
    } else {
        const auto report = bench_pulls(given.options);
        write_output(json ? cles::to_json(report) + "\n" : table_of(report));
    }
}

} // namespace

void add_bench(CLI::App& app, int& exit_code) {
    auto given = std::make_shared<arguments>();
    auto& options = given->options;
    auto* command = app.add_subcommand("bench", description);
    command->footer(examples);
    command->add_option("--transport", given->transport, "What carries the CLES exchange: tcp, udp, unix or inproc")
        ->check(CLI::IsMember(keys_of(carriers)).description(""))
        ->type_name("NAME");
    command->add_option("--in-flight", options.in_flight, "PULLs in flight at once on one link (1)")
        ->check(CLI::Range(std::size_t{1}, most_in_flight).description(""))
        ->type_name("N");
    command->add_option("--against", options.against, "A node that runs already and offers localization")
        ->type_name("URL");
    auto* requests = command->add_option("--requests", options.requests,
                                         "Requests, or with --updates updates, in each pass (50000; 1000000 where "
                                         "many are in flight or published; the baseline at most 50000 then)");
    requests->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}).description(""))->type_name("N");
    command->add_option("--duration", given->duration, "How long each pass takes, instead of --requests")
        ->excludes(requests)
        ->type_name("TIME");
    command->add_option("--rounds", options.rounds, "Passes of each exchange, of which the medians are taken (5)")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000}).description(""))
        ->type_name("N");
    command->add_option("--style", given->style, "How results reach the caller's code: coroutine or callback")
        ->check(CLI::IsMember(keys_of(styles)).description(""))
        ->type_name("NAME");
    command
        ->add_option("--busy-poll", given->busy_poll_us,
                     "Let both ends of CLES look for work so long before they sleep, in microseconds (0)")
        ->check(CLI::Range(0, most_busy_poll_us).description(""))
        ->type_name("US");
    command->add_flag("--one-core", options.one_core, "Put both ends on one core");
    command->add_flag("--stress", given->stress,
                      "Measure the tail of PULL's latency while other processes want all cores, with and without "
                      "real-time scheduling");
    command->add_flag("--updates", given->updates, "Measure UPDATE to binders instead of PULL");
    command->add_option("--binders", options.binders, "Bindings, each on a link of its own (1)")
        ->check(CLI::Range(std::size_t{1}, most_binders).description(""))
        ->type_name("N");
    command->add_option("--keep", options.keep, "Updates that the publisher queues for each binder (64)")
        ->check(CLI::Range(std::uint32_t{1}, std::uint32_t{65536}).description(""))
        ->type_name("N");
    command->add_option("-o,--output", given->form, "table or json (table)")
        ->check(CLI::IsMember({"table", "json"}).description(""))
        ->type_name("FORM");
    command->callback([command, given, &exit_code] {
        run(*command, *given);
        exit_code = exit_code::success;
    });
}

} // namespace tool
