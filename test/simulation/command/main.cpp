// SPDX-License-Identifier: BSL-1.0
// Simulates seeds, or plans that are read from files, and reports violations; measures gossip among many nodes; or
// drives a platoon (README.md of the folder above).
#include "simulation/gossip_network.hpp"
#include "simulation/mesh.hpp"
#include "simulation/sharing.hpp"
#include "simulation/world/simulate.hpp"
#if CLES_SIMULATION_PLATOON
#include <cles/convert.hpp>

#include "simulation/platoon.hpp"
#endif

#include <boost/describe/enum_from_string.hpp>

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iomanip>
#include <iostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::simulation;
using namespace std::chrono_literals;
using std::chrono::milliseconds;

/// The seeds to simulate.
struct seed_range {
    std::uint64_t first = 1;
    std::uint64_t count = 1;
};

/// Whether there are none.
bool print(const std::string& run, const std::vector<violation>& all) {
    for (const auto& v : all) {
        std::cout << run << ": " << to_string(v.broken) << ": " << v.what << '\n';
    }
    return all.empty();
}

int print_failed(std::uint64_t failed, std::uint64_t of) {
    std::cout << failed << " of " << of << " failed\n";
    return failed == 0 ? 0 : 1;
}

double seconds_since(std::chrono::steady_clock::time_point begun) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

/// Runs a simulation with each seed, and prints its report.
template <class Simulation>
int run_seeds(const seed_range& seeds, Simulation simulate) {
    std::uint64_t failed = 0;
    for (auto seed = seeds.first; seed < seeds.first + seeds.count; ++seed) {
        const auto begun = std::chrono::steady_clock::now();
        const auto r = simulate(seed);
        const auto run = "seed " + std::to_string(seed);
        failed += print(run, r.violations) ? 0 : 1;
        std::cout << run << ": " << to_text(r) << "; took " << std::fixed << std::setprecision(1)
                  << seconds_since(begun) << " s" << std::endl;
    }
    return print_failed(failed, seeds.count);
}

// -- seeds and plans -----------------------------------------------------------------------------------------------

struct options {
    seed_range seeds{};
    unsigned steps = 300;
    bool secured = false;
    bool twice = false;
    bool trace = false;
    bool minimise = false;
    bool print = false;
    bool bench = false;
    planted fault = planted::none;
    std::vector<std::string> files{};
};

/// Whether there was no violation.
bool live_through(const plan& p, const std::string& name, const options& o, report& sum) {
    if (o.print) {
        std::cout << to_text(p);
        return true;
    }
    witness::reader reader;
    if (o.trace) {
        reader = [](const std::string& line) { std::cout << line << '\n'; };
    }
    const auto r = o.twice ? simulate_twice(p, o.fault) : simulate(p, o.fault, reader);
    sum.node_seconds += r.node_seconds;
    sum.requests += r.requests;
    sum.updates += r.updates;
    sum.datagrams += r.datagrams;
    sum.steps += r.steps;
    const bool good = print(name, r.violations);
    if (!good && o.minimise) {
        const auto& first = r.violations.front();
        std::cout << "# " << to_string(first.broken) << ": " << first.what << '\n'
                  << to_text(minimise(p, first.broken, o.fault));
    }
    return good;
}

int run(const options& o) {
    report sum;
    std::uint64_t failed = 0;
    const auto begun = std::chrono::steady_clock::now();
    for (const auto& path : o.files) {
        failed += live_through(plan_in_file(path), path, o, sum) ? 0 : 1;
    }
    for (std::uint64_t i = 0; o.files.empty() && i < o.seeds.count; ++i) {
        const auto seed = o.seeds.first + i;
        failed += live_through(make_plan(seed, o.steps, o.secured), "seed " + std::to_string(seed), o, sum) ? 0 : 1;
    }
    if (o.bench) {
        std::cout << std::fixed << std::setprecision(0) << sum.node_seconds << " node-seconds with " << sum.requests
                  << " requests, " << sum.updates << " updates, " << sum.datagrams << " datagrams, " << sum.steps
                  << " events in " << std::setprecision(2) << seconds_since(begun) << " s\n";
    }
    return o.print ? 0 : print_failed(failed, o.files.empty() ? o.seeds.count : o.files.size());
}

// -- gossip --------------------------------------------------------------------------------------------------------

struct gossip_options {
    std::size_t nodes = 1000;
    std::size_t minutes = 30;
    std::uint64_t seed = 1;
    std::string only{};

    [[nodiscard]] bool wants(std::string_view part) const { return only.empty() || only == part; }
};

int breaches = 0;

void tell(const char* what, double measured, double most, const char* unit) {
    const bool good = measured <= most;
    breaches += good ? 0 : 1;
    std::printf("%-58s %10.1f %-5s (at most %.1f)%s\n", what, measured, unit, most, good ? "" : "  BROKEN");
    std::fflush(stdout);
}

double seconds(milliseconds t) { return std::chrono::duration<double>(t).count(); }

void cold_start_and_calm(const gossip_options& o) {
    gossip_network net{o.seed};
    net.start(o.nodes, 1s);
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell("tables whole after the last node's cold start", seconds(whole), 15, "s");
    tell("  live nodes taken for gone meanwhile", static_cast<double>(net.false_deaths()), 0, "");
    net.pass(60s);
    net.take_received(1s);
    net.pass(60s);
    const auto bytes = net.take_received(60s);
    tell("received per node, steady: on average", bytes.average / 1000, 20, "kB/s");
    tell("  of the node that received the most", bytes.most / 1000, 40, "kB/s");
    // A suspicion ends with the next message and costs little: requests to the node by name are still sent. Most occur
    // at the start, when nodes know few others and so expect messages often.
    const auto pairs = static_cast<double>(o.nodes * (o.nodes - 1));
    tell("  live nodes suspected since the start, of 10,000 pairs",
         static_cast<double>(net.false_suspicions()) * 1e4 / pairs, 1, "");
}

void partition(const gossip_options& o, milliseconds lasts, const char* what) {
    gossip_network net{o.seed + 1};
    net.start(o.nodes, 1s);
    net.pass(30s);
    net.allow([](std::size_t from, std::size_t to) { return from % 2 == to % 2; });
    net.pass(lasts);
    net.allow({});
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell(what, seconds(whole), 15, "s");
}

void rough_weather(const gossip_options& o) {
    gossip_network net{o.seed + 2, {.loss = 50, .paused = 20}};
    net.start(o.nodes, 1s);
    const auto whole = net.pass_until([&] { return net.whole(); }, 60s);
    tell("whole after a cold start, 5 % loss, 2 % stopped", seconds(whole), 15, "s");
    for (std::size_t minute = 1; minute <= o.minutes; ++minute) {
        net.take_received(1s);
        net.pass(60s);
        const auto bytes = net.take_received(60s);
        std::printf(
            "  minute %zu: %.1f kB/s received, live nodes taken for gone %zu, suspected %zu, pairs missing %zu\n",
            minute, bytes.average / 1000, net.false_deaths(), net.false_suspicions(), net.missing());
        std::fflush(stdout);
    }
    tell("live nodes taken for gone in all that time", static_cast<double>(net.false_deaths()), 0, "");
    tell("clashes reported", static_cast<double>(net.clashes()), 0, "");
}

int measure_gossip(const gossip_options& o) {
    if (o.wants("start")) {
        cold_start_and_calm(o);
    }
    if (o.wants("short-cut")) {
        partition(o, 30s, "whole after a cut of 30 s");
    }
    if (o.wants("long-cut")) {
        partition(o, milliseconds{200} * static_cast<int>(o.nodes) + 30s,
                  "whole after a cut for longer than nodes are remembered");
    }
    if (o.wants("weather")) {
        rough_weather(o);
    }
    return breaches == 0 ? 0 : 1;
}

// -- platoon -------------------------------------------------------------------------------------------------------

#if CLES_SIMULATION_PLATOON
struct platoon_options {
    seed_range seeds{};
    double loss_percent = 0, burst = 0, delay_ms = 0;
    std::vector<double> lags{}, brakes{};
    bool json = false, no_radar = false;
    std::vector<std::size_t> minimum{}, older{};
    bool leader_unknown = false;
    platoon::scenario what{};
};

int drive_platoon(const platoon_options& o) {
    auto what = o.what;
    const double loss = o.loss_percent / 100;
    if (o.burst > 0 && (loss >= 1 || o.burst < platoon::gilbert_elliott::shortest(loss))) {
        throw std::runtime_error{"--burst: at this loss, bursts have at least loss / (1 - loss) updates on average"};
    }
    what.losses = platoon::losses_of(loss, o.burst);
    what.delay = o.delay_ms / 1000;
    what.setup.radar.fitted = !o.no_radar;
    what.setup.law = platoon::gains_for(what.setup.hz);
    if (!o.lags.empty()) {
        what.differences.least_lag = o.lags.front();
        what.differences.most_lag = o.lags.back();
    }
    if (!o.brakes.empty()) {
        what.differences.least_brake = o.brakes.front();
        what.differences.most_brake = o.brakes.back();
    }
    what.dialects.resize(what.vehicles);
    for (const auto each : o.older) {
        what.dialects.at(each) = platoon::dialect::older;
    }
    for (const auto each : o.minimum) {
        what.dialects.at(each) = platoon::dialect::minimum;
    }
    what.leader_known = !o.leader_unknown;
    what.seed = o.seeds.first;
    auto all = platoon::outcome_of(what);
    std::uint64_t broken = 0;
    std::uint64_t received = 0;
    std::uint64_t missed = 0;
    std::uint64_t copies = 0;
    std::uint64_t lost = 0;
    for (; what.seed < o.seeds.first + o.seeds.count; ++what.seed) {
        const auto one = simulate_platoon(what);
        broken += print("seed " + std::to_string(what.seed), one.violations) ? 0 : 1;
        platoon::add(all, one.drive);
        received += one.received;
        missed += one.missed;
        copies += one.copies;
        lost += one.lost;
        constexpr std::uint64_t most_lines = 20;
        if (!o.json && o.seeds.count <= most_lines) {
            std::fputs(platoon::line_of(what.seed, one.drive).c_str(), stdout);
            std::fflush(stdout);
        }
    }
    if (o.json) {
        std::puts(cles::to_json(all).c_str());
    } else {
        std::fputs(platoon::summary_of(all).c_str(), stdout);
        std::printf("network   %ju of %ju datagrams lost, counted for each receiver\n"
                    "gaps      %ju updates missing of %ju, as the nodes reported\n",
                    std::uintmax_t{lost}, std::uintmax_t{copies}, std::uintmax_t{missed},
                    std::uintmax_t{received + missed});
    }
    return broken != 0 ? 2 : platoon::exit_code_of(all);
}

void add_platoon(CLI::App& to, platoon_options& o) {
    to.add_option("--first-seed,--seed", o.seeds.first, "The first seed");
    to.add_option("--seeds", o.seeds.count, "How many");
    to.add_option("-n,--vehicles", o.what.vehicles, "How many")->check(CLI::Range(2, 100));
    to.add_option("--hz", o.what.setup.hz, "Updates of each vehicle per second")->check(CLI::Range(10.0, 50.0));
    to.add_option("--seconds", o.what.seconds, "Duration (0: until the leader's manoeuvre ends)");
    to.add_option("--loss", o.loss_percent, "Datagrams that each receiver loses, in percent")
        ->check(CLI::Range(0.0, 100.0));
    to.add_option("--burst", o.burst, "They are lost in bursts, with this mean number (0: independently)");
    to.add_option("--delay", o.delay_ms, "Their delay in ms: at least half of it, at most all of it");
    to.add_option("--lags", o.lags, "Engines and brakes lag by LOW to HIGH seconds")->expected(2);
    to.add_option("--brakes", o.brakes, "Vehicles brake with at most LOW to HIGH m/s²")->expected(2);
    to.add_option("--brake-at", o.what.setup.plan.brake_at, "The leader brakes at this time, s");
    to.add_option("--minimum", o.minimum, "These vehicles tell only the paper's minimum")->delimiter(',');
    to.add_option("--older", o.older, "These vehicles tell what older ones do")->delimiter(',');
    to.add_flag("--leader-unknown", o.leader_unknown, "Those behind them do not know the leader");
    to.add_flag("--no-radar", o.no_radar, "Vehicles have no radar");
    to.add_flag("--json", o.json, "Print the results of all drives as JSON");
}
#endif

// -- options -------------------------------------------------------------------------------------------------------

void add_seeds(CLI::App& to, seed_range& seeds) {
    to.add_option("--seed", seeds.first, "The first seed");
    to.add_option("--seeds", seeds.count, "How many");
}

void add_mesh(CLI::App& to, unsigned& nodes, unsigned& mean_degree) {
    to.add_option("--nodes", nodes, "How many")->check(CLI::Range(2, 5000));
    to.add_option("--degree", mean_degree, "The mean number of links of a node")->check(CLI::Range(2, 16));
}

/// An option whose values are the names of an enumeration.
template <class Enum>
void add_choice(CLI::App& to, const std::string& option, Enum& chosen, const std::string& text) {
    to.add_option_function<std::string>(
        option,
        [option, &chosen](const std::string& name) {
            if (!boost::describe::enum_from_string(name.c_str(), chosen)) {
                throw CLI::ValidationError{option, "there is no '" + name + "'"};
            }
        },
        text);
}

} // namespace

int main(int argc, char** argv) {
    CLI::App program{"Simulates nodes and their network in virtual time."};
    program.option_defaults()->always_capture_default();
    options given;
    add_seeds(program, given.seeds);
    program.add_option("--steps", given.steps, "What happens in each from the outside");
    program.add_flag("--secured", given.secured, "Nodes with security, whose roster changes, and an attacker");
    program.add_flag("--twice", given.twice, "Each twice, to see that both are the same");
    program.add_flag("--trace", given.trace, "Tells all that happens");
    program.add_flag("--minimise", given.minimise, "Makes a plan that fails smaller, and prints it");
    program.add_flag("--plan", given.print, "Prints the plans and simulates nothing");
    add_choice(program, "--plant", given.fault, "With this fault planted");
    program.add_flag("--bench", given.bench, "Tells how much was simulated");
    program.add_option("files", given.files, "Plans in files, instead of seeds");

    auto* mesh = program.add_subcommand("mesh", "Simulates nodes that reach each other through others");
    mesh_setup sparse{.nodes = 40};
    seed_range mesh_seeds{.count = 10};
    add_seeds(*mesh, mesh_seeds);
    add_mesh(*mesh, sparse.nodes, sparse.mean_degree);
    add_choice(*mesh, "--form", sparse.form, "random, line, ring, star or grid");
    mesh->add_option("--cuts", sparse.cuts, "Links that are lost");
    mesh->add_option("--crashes", sparse.crashes, "Nodes that crash");
    mesh->add_option("--requests", sparse.requests, "After each change");
    mesh->add_flag("!--undeclared", sparse.declared, "The nodes have to find out which links there are");
    mesh->add_option("--hops", sparse.hops, "How many nodes may forward a request");
    mesh->add_flag("--secured", sparse.secured, "The nodes are members of a fleet");

    auto* sharing = program.add_subcommand("sharing", "Simulates nodes that share their jobs");
    sharing_setup shared;
    seed_range sharing_seeds;
    add_seeds(*sharing, sharing_seeds);
    add_mesh(*sharing, shared.nodes, shared.mean_degree);
    sharing->add_option("--clients", shared.clients, "That submit jobs");
    sharing->add_option("--jobs", shared.jobs, "In all");
    sharing->add_option("--faults", shared.faults_per_minute, "For each node in a minute");

    auto* gossip = program.add_subcommand("gossip", "Measures gossip among many nodes");
    gossip_options many;
    gossip->add_option("--nodes", many.nodes, "How many");
    gossip->add_option("--minutes", many.minutes,
                       "How long, with 5 % of packets lost and each process stopped for 2 % of the time");
    gossip->add_option("--seed", many.seed, "Of chance");
    gossip->add_option("--only", many.only, "This part alone")
        ->check(CLI::IsMember({"start", "short-cut", "long-cut", "weather"}));
#if CLES_SIMULATION_PLATOON
    auto* vehicles = program.add_subcommand("platoon", "Drives a platoon, each vehicle on a node");
    platoon_options driven;
    add_platoon(*vehicles, driven);
#endif
    CLI11_PARSE(program, argc, argv);
    try {
        if (*gossip) {
            return measure_gossip(many);
        }
        if (*mesh) {
            return run_seeds(mesh_seeds, [&](std::uint64_t seed) { return simulate_mesh(seed, sparse, given.fault); });
        }
        if (*sharing) {
            return run_seeds(sharing_seeds,
                             [&](std::uint64_t seed) { return simulate_sharing(seed, shared, given.fault); });
        }
#if CLES_SIMULATION_PLATOON
        if (*vehicles) {
            return drive_platoon(driven);
        }
#endif
        return run(given);
    } catch (const std::exception& e) {
        std::cerr << "cles_simulation: " << e.what() << '\n';
        return 2;
    }
}
