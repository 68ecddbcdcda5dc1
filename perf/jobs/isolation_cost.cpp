// SPDX-License-Identifier: BSL-1.0
// What it costs to run a plugin in a process of its own: an empty DELEGATE to a plugin in the daemon, the same to an
// isolated one, and a PULL over a Unix socket, all in turns. Prints medians of the rounds.
//
//   cles_isolation_cost PLUGIN [--rounds N] [--spread]
//
// The client has one core, and all of the daemon, with the plugin's process, another; with --spread these may run on
// all cores. Exits with 1 if isolation costs more than 1.2 PULLs.
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "delegate_load.hpp"
#include "isolation/plugin_process_main.hpp"
#include "job_daemon.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/number_option.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>

namespace {

namespace perf = cles::perf;

constexpr std::size_t requests = 5'000;
constexpr double most = 1.2; // PULLs

struct options {
    std::string plugin;
    unsigned rounds = 5;
    bool spread = false;
};

options read(std::span<char*> arguments) {
    options o;
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const std::string_view option = arguments[i];
        if (option == "--spread") {
            o.spread = true;
        } else if (option == "--rounds" && i + 1 < arguments.size()) {
            o.rounds = perf::number(option, arguments[++i], 1000U);
        } else if (!option.starts_with('-') && o.plugin.empty()) {
            o.plugin = option;
        } else {
            throw std::invalid_argument("'" + std::string{option} + "' is not an option");
        }
    }
    if (o.plugin.empty()) {
        throw std::invalid_argument("usage: cles_isolation_cost PLUGIN [--rounds N] [--spread]");
    }
    return o;
}

int measure(const options& o) {
    const auto ends = perf::place_ends();
    const auto cores = o.spread ? perf::usable_cores() : std::vector{ends.server};
    const auto run_with = [&](bool isolated) {
        return [&, isolated](const perf::child_process::announce& announce) {
            perf::run_daemon({.path = o.plugin, .isolated = isolated}, 2, cores, {}, announce);
        };
    };
    const auto socket = std::filesystem::temp_directory_path() / ("cles-isolation-" + std::to_string(::getpid()));
    perf::child_process served{ends.server, [&](const perf::child_process::announce& announce) {
                                   perf::serve_localization("unix://" + socket.string(), {}, announce);
                               }};
    perf::child_process in_daemon{ends.server, run_with(false)};
    perf::child_process apart{ends.server, run_with(true)};
    perf::pin_to(ends.client);
    boost::asio::io_context io{1};
    cles::service to_served{io, {.name = "asker", .peers = {{"car1", served.announced()}}}};
    cles::service to_daemon{io, {.name = "bench", .peers = {{"car1", in_daemon.announced()}}}};
    cles::service to_isolated{io, {.name = "bench2", .peers = {{"car1", apart.announced()}}}};
    perf::pull_load pulls{io, to_served, "car1:localization", perf::handler_style::callback, false};
    perf::delegate_load here{io, to_daemon, "car1:empty", {}};
    perf::delegate_load there{io, to_isolated, "car1:empty", {}};

    std::vector<double> pull_us, here_us, there_us, cost;
    for (unsigned round = 0; round <= o.rounds; ++round) {
        perf::latency_recorder pulled{requests};
        pulls.run(1, std::chrono::minutes{1}, pulled);
        perf::latency_recorder in_process{requests};
        here.run(1, in_process);
        perf::latency_recorder isolated{requests};
        there.run(1, isolated);
        if (round == 0) {
            continue; // to warm up
        }
        pull_us.push_back(pulled.quantiles().p50);
        here_us.push_back(in_process.quantiles().p50);
        there_us.push_back(isolated.quantiles().p50);
        cost.push_back((there_us.back() - here_us.back()) / pull_us.back());
    }
    std::filesystem::remove(socket);
    const auto pull = perf::median(pull_us), in_process = perf::median(here_us), isolated = perf::median(there_us);
    const auto limit = in_process + most * pull;
    std::printf("PULL over a Unix socket, p50     %8.1f us\n", pull);
    std::printf("empty DELEGATE in process, p50   %8.1f us\n", in_process);
    std::printf("empty DELEGATE isolated, p50     %8.1f us, limit %.1f us\n", isolated, limit);
    std::printf("cost of isolation                %8.2f PULLs (%.2f to %.2f)\n", (isolated - in_process) / pull,
                *std::min_element(cost.begin(), cost.end()), *std::max_element(cost.begin(), cost.end()));
    return isolated <= limit ? EXIT_SUCCESS : EXIT_FAILURE;
}

} // namespace

int main(int argc, char** argv) {
    if (cles::runtime::is_plugin_process(argc, argv)) { // the daemon starts this program, because it is a part of it
        return cles::runtime::run_plugin_process(argc, argv);
    }
    try {
        return measure(read({argv, static_cast<std::size_t>(argc)}));
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "cles_isolation_cost: %s\n", failed.what());
        return 1;
    }
}
