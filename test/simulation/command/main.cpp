// SPDX-License-Identifier: BSL-1.0
// Simulates seeds, or plans that are read from files, and reports violations; or measures gossip among many nodes
// (README.md of the folder above).
#include "simulation/gossip_network.hpp"
#include "simulation/mesh.hpp"
#include "simulation/sharing.hpp"
#include "simulation/world/simulate.hpp"

#include <boost/describe/enum_from_string.hpp>

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iomanip>
#include <iostream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::simulation;
using namespace std::chrono_literals;
using std::chrono::milliseconds;

// -- seeds and plans -----------------------------------------------------------------------------------------------

struct options {
    std::uint64_t seed = 1;
    std::uint64_t seeds = 1;
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
    for (const auto& v : r.violations) {
        std::cout << name << ": " << to_string(v.broken) << ": " << v.what << '\n';
    }
    if (!r.violations.empty() && o.minimise) {
        const auto& first = r.violations.front();
        std::cout << "# " << to_string(first.broken) << ": " << first.what << '\n'
                  << to_text(minimise(p, first.broken, o.fault));
    }
    return r.violations.empty();
}

int run(const options& o) {
    report sum;
    std::uint64_t failed = 0;
    const auto begun = std::chrono::steady_clock::now();
    for (const auto& path : o.files) {
        failed += live_through(plan_in_file(path), path, o, sum) ? 0 : 1;
    }
    for (std::uint64_t i = 0; o.files.empty() && i < o.seeds; ++i) {
        const auto seed = o.seed + i;
        failed += live_through(make_plan(seed, o.steps, o.secured), "seed " + std::to_string(seed), o, sum) ? 0 : 1;
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
    if (o.bench) {
        std::cout << std::fixed << std::setprecision(0) << sum.node_seconds << " node-seconds with " << sum.requests
                  << " requests, " << sum.updates << " updates, " << sum.datagrams << " datagrams, " << sum.steps
                  << " events in " << std::setprecision(2) << took.count() << " s\n";
    }
    if (!o.print) {
        std::cout << failed << " of " << (o.files.empty() ? o.seeds : o.files.size()) << " failed\n";
    }
    return failed == 0 ? 0 : 1;
}

// -- meshes --------------------------------------------------------------------------------------------------------

struct mesh_options {
    std::uint64_t seed = 1;
    std::uint64_t seeds = 10;
    mesh_setup setup{.nodes = 40};
};

int simulate_meshes(const mesh_options& o) {
    std::uint64_t failed = 0;
    for (auto seed = o.seed; seed < o.seed + o.seeds; ++seed) {
        const auto r = simulate_mesh(seed, o.setup);
        for (const auto& v : r.violations) {
            std::cout << "seed " << seed << ": " << to_string(v.broken) << ": " << v.what << '\n';
        }
        failed += r.violations.empty() ? 0 : 1;
        std::cout << "seed " << seed << ": shortest routes after " << r.converged.count() << " ms, another way after "
                  << r.rerouted.count() << " ms at most, for all of " << r.cut << " pairs after "
                  << r.all_rerouted.count() << " ms, " << r.answered << " of " << r.asked << " requests answered, over "
                  << r.longest << " links at most; a node receives " << r.bytes << " bytes in an interval, "
                  << r.bytes_of_routes << " of routes" << std::endl;
    }
    std::cout << failed << " of " << o.seeds << " failed\n";
    return failed == 0 ? 0 : 1;
}

// -- sharing -------------------------------------------------------------------------------------------------------

struct sharing_options {
    std::uint64_t seed = 1;
    std::uint64_t seeds = 1;
    sharing_setup setup{};
};

int simulate_shared_work(const sharing_options& o, planted fault) {
    std::uint64_t failed = 0;
    for (auto seed = o.seed; seed < o.seed + o.seeds; ++seed) {
        const auto begun = std::chrono::steady_clock::now();
        const auto r = simulate_sharing(seed, o.setup, fault);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
        for (const auto& v : r.violations) {
            std::cout << "seed " << seed << ": " << to_string(v.broken) << ": " << v.what << '\n';
        }
        failed += r.violations.empty() ? 0 : 1;
        std::cout << "seed " << seed << ": " << r.jobs << " jobs, " << r.succeeded << " succeeded";
        for (const auto& [code, count] : r.failed) {
            std::cout << ", " << count << ' ' << code;
        }
        std::cout << "; " << r.moved << " moved, " << r.returned << " returned, " << r.grants << " grants; " << r.faults
                  << " faults; " << std::fixed << std::setprecision(1) << r.seconds << " s in " << took.count()
                  << " s\n";
        std::cout.flush();
    }
    std::cout << failed << " of " << o.seeds << " failed\n";
    return failed == 0 ? 0 : 1;
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

} // namespace

int main(int argc, char** argv) {
    CLI::App program{"Simulates nodes and their network in virtual time."};
    options given;
    program.add_option("--seed", given.seed, "The first seed")->capture_default_str();
    program.add_option("--seeds", given.seeds, "How many")->capture_default_str();
    program.add_option("--steps", given.steps, "What happens in each from the outside")->capture_default_str();
    program.add_flag("--secured", given.secured, "Nodes with security, whose roster changes, and an attacker");
    program.add_flag("--twice", given.twice, "Each twice, to see that both are the same");
    program.add_flag("--trace", given.trace, "Tells all that happens");
    program.add_flag("--minimise", given.minimise, "Makes a plan that fails smaller, and prints it");
    program.add_flag("--plan", given.print, "Prints the plans and simulates nothing");
    program.add_option_function<std::string>(
        "--plant",
        [&given](const std::string& name) {
            if (!boost::describe::enum_from_string(name.c_str(), given.fault)) {
                throw CLI::ValidationError{"--plant", "there is no such fault to plant"};
            }
        },
        "With this fault planted");
    program.add_flag("--bench", given.bench, "Tells how much was simulated");
    program.add_option("files", given.files, "Plans in files, instead of seeds");
    gossip_options many;
    mesh_options sparse;
    auto* mesh = program.add_subcommand("mesh", "Simulates nodes that reach each other through others");
    mesh->add_option("--nodes", sparse.setup.nodes, "How many")->capture_default_str()->check(CLI::Range(2, 5000));
    mesh->add_option("--degree", sparse.setup.mean_degree, "The mean number of links of a node")
        ->capture_default_str()
        ->check(CLI::Range(2, 16));
    mesh->add_option("--form", sparse.setup.form, "random, line, ring, star or grid")
        ->transform(CLI::CheckedTransformer(std::map<std::string, mesh_form>{{"random", mesh_form::random},
                                                                             {"line", mesh_form::line},
                                                                             {"ring", mesh_form::ring},
                                                                             {"star", mesh_form::star},
                                                                             {"grid", mesh_form::grid}}));
    mesh->add_option("--cuts", sparse.setup.cuts, "Links that are lost")->capture_default_str();
    mesh->add_option("--crashes", sparse.setup.crashes, "Nodes that crash")->capture_default_str();
    mesh->add_option("--requests", sparse.setup.requests, "After each change")->capture_default_str();
    mesh->add_flag("!--undeclared", sparse.setup.declared, "The nodes have to find out which links there are");
    mesh->add_option("--hops", sparse.setup.hops, "How many nodes may forward a request")->capture_default_str();
    mesh->add_flag("--secured", sparse.setup.secured, "The nodes are members of a fleet");
    mesh->add_option("--seed", sparse.seed, "The first")->capture_default_str();
    mesh->add_option("--seeds", sparse.seeds, "How many")->capture_default_str();
    sharing_options shared;
    auto* sharing = program.add_subcommand("sharing", "Simulates nodes that share their jobs");
    sharing->add_option("--nodes", shared.setup.nodes, "How many")->capture_default_str()->check(CLI::Range(2, 5000));
    sharing->add_option("--degree", shared.setup.mean_degree, "The mean number of links of a node")
        ->capture_default_str()
        ->check(CLI::Range(2, 16));
    sharing->add_option("--clients", shared.setup.clients, "That submit jobs")->capture_default_str();
    sharing->add_option("--jobs", shared.setup.jobs, "In all")->capture_default_str();
    sharing->add_option("--faults", shared.setup.faults_per_minute, "For each node in a minute")->capture_default_str();
    sharing->add_option("--seed", shared.seed, "The first")->capture_default_str();
    sharing->add_option("--seeds", shared.seeds, "How many")->capture_default_str();
    auto* gossip = program.add_subcommand("gossip", "Measures gossip among many nodes");
    gossip->add_option("--nodes", many.nodes, "How many")->capture_default_str();
    gossip
        ->add_option("--minutes", many.minutes,
                     "How long, with 5 % of packets lost and each process stopped for 2 % of the time")
        ->capture_default_str();
    gossip->add_option("--seed", many.seed, "Of chance")->capture_default_str();
    gossip->add_option("--only", many.only, "This part alone")
        ->check(CLI::IsMember({"start", "short-cut", "long-cut", "weather"}));
    CLI11_PARSE(program, argc, argv);
    try {
        return *gossip    ? measure_gossip(many)
               : *mesh    ? simulate_meshes(sparse)
               : *sharing ? simulate_shared_work(shared, given.fault)
                          : run(given);
    } catch (const std::exception& e) {
        std::cerr << "cles_simulation: " << e.what() << '\n';
        return 2;
    }
}
