// SPDX-License-Identifier: BSL-1.0
#include "check_arguments.hpp"
#include "failure.hpp"
#include "local.hpp"
#include "neighbours/neighbours_command.hpp"
#include "output/end_of_output.hpp"
#include "pool.hpp"
#include "rounds/rounds_command.hpp"
#include "sgd/parallel.hpp"
#include "trial.hpp"
#include "verdict.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <functional>

namespace {

using dsgd::report_failure;

constexpr std::size_t default_shards = 4;

struct arguments {
    std::optional<std::size_t> shards{};
    std::size_t threads = 0;
    std::vector<std::string> seeds{"tcp://127.0.0.1:25370"}, nodes{};
    std::uint64_t epochs = 100, seed = 1, deadline_s = 60;
    double rate = 1e-4;
    bool weighted = false, resplit = false, json = false;
};

struct report {
    std::string error{};
    std::string shortcoming{};    ///< of the result; empty if it is good
    double trial_ms = 0;          ///< contained in the elapsed time
    double trial_shortest_ms = 0; ///< the least time of a shard by which speeds were measured
    std::uint64_t trial_attempts = 0;
    dsgd::times times{};
    sgd::classifier result{};
    sgd::quality quality{};
    std::vector<dsgd::entry> shards{};
    std::vector<sgd::trained> parts{};
};
BOOST_DESCRIBE_STRUCT(report, (),
                      (error, shortcoming, trial_ms, trial_shortest_ms, trial_attempts, times, result, quality, shards,
                       parts))

int report_result(const arguments& args, const sgd::data_set& data, const dsgd::board& all,
                  const dsgd::trial* before = nullptr) {
    report out{.shards = all.shards(), .parts = all.parts()};
    if (before != nullptr) {
        out.trial_ms = before->spent_ms();
        out.trial_shortest_ms = before->shortest_ms();
        out.trial_attempts = before->attempts();
    }
    if (all.failure()) {
        out.error = all.failure()->message();
    } else {
        out.times = all.spent(out.trial_ms);
        out.result = average(out.parts);
        out.quality = judge(data, out.result);
        out.shortcoming = dsgd::shortcoming(out.quality);
    }
    if (args.json) {
        std::puts(cles::to_json(out).c_str());
        return all.failure() ? report_failure(*all.failure()) : dsgd::report_shortcoming(out.shortcoming);
    }
    for (std::size_t i = 0; i < out.parts.size(); ++i) {
        std::printf("%-9s %7ju points  %9.3f ms  %s\n", out.shards[i].fate.c_str(),
                    std::uintmax_t{out.shards[i].what.count}, out.parts[i].ms, out.parts[i].node.c_str());
    }
    if (all.failure()) {
        return report_failure(*all.failure());
    }
    std::printf("elapsed   %.3f ms: the longest %s %.3f, overhead %.3f\n", out.times.elapsed_ms,
                args.resplit ? "slot" : "shard", out.times.longest_ms, out.times.overhead_ms);
    if (before != nullptr) {
        std::printf("trial     %.3f ms, contained in the overhead\n", out.trial_ms);
    }
    std::printf("mse       %.7f; best possible %.7f; %.4f %% of the points in the wrong class\n", out.quality.mse,
                out.quality.least_mse, out.quality.wrong * 100);
    return dsgd::report_shortcoming(out.shortcoming);
}

int run_local(const arguments& args, const sgd::order& setup) {
    const sgd::data_set data{*setup.data};
    const auto orders = orders_for(sgd::divide(data.size(), std::vector<double>(args.threads, 1)), setup);
    dsgd::board all{orders, {"here"}};
    while (all.next(0)) {
    }
    for (std::size_t i = 0; const auto& part : dsgd::train_here(data, orders)) {
        if (!sgd::is_finite(part.result)) {
            throw cles::error(cles::errc::failed, sgd::diverged);
        }
        all.done(i++, part);
    }
    return report_result(args, data, all);
}

/// What the data of all these nodes is made from.
sgd::recipe common_data(const std::map<std::string, sgd::recipe>& offered, const std::vector<std::string>& nodes) {
    for (const auto& node : nodes) {
        if (!offered.contains(node)) {
            throw cles::error(cles::errc::no_target, "'" + node + "' does not offer 'sgd': see cles ls --tasks");
        }
        if (const auto& first = offered.at(nodes.front()), &data = offered.at(node); data != first) {
            throw cles::error(cles::errc::bad_request, "'" + nodes.front() + "' and '" + node +
                                                           "' have different data: " + to_string(first) + ", and " +
                                                           to_string(data) + ". Name nodes with the same (--nodes)");
        }
    }
    return offered.at(nodes.front());
}

int run(const arguments& args, sgd::order setup) {
    dsgd::pool pool{args.seeds, std::chrono::seconds{args.deadline_s}, !args.json};
    const auto offered = pool.find();
    auto nodes = args.nodes;
    for (const auto& each : offered) {
        if (args.nodes.empty()) {
            nodes.push_back(each.first);
        }
    }
    setup.data = common_data(offered, nodes);
    pool.admit(*setup.data, nodes, args.nodes);
    const sgd::data_set data{*setup.data};
    const bool by_speed = args.weighted || args.resplit;
    const auto targets = args.nodes.empty() && !by_speed ? std::vector<std::string>{} : nodes;
    const auto shards = args.shards.value_or(by_speed ? std::max(default_shards, targets.size()) : default_shards);
    if (shards < targets.size()) {
        std::fprintf(stderr, "cles-dsgd: %zu nodes have nothing to do: there are only %zu shards\n",
                     targets.size() - shards, shards);
    }
    if (args.resplit) {
        const auto least = dsgd::least_points(setup);
        if (const auto with_work = std::max<std::size_t>(1, data.size() / least); with_work < shards) {
            std::fprintf(stderr,
                         "cles-dsgd: only %zu of %zu slots have work: with these epochs and this rate, a shard has at "
                         "least %ju points\n",
                         with_work, shards, std::uintmax_t{least});
        }
        dsgd::board all{data.size(), shards, setup, targets};
        pool.train(all);
        return report_result(args, data, all);
    }
    if (args.weighted) {
        dsgd::trial before{data.size(), shards, setup, targets};
        while (!before.finished()) {
            auto attempt = before.attempt();
            pool.train(attempt, "trial, ");
            if (attempt.failure()) {
                return report_result(args, data, attempt);
            }
            before.take(attempt);
        }
        dsgd::board all{orders_for(sgd::divide(data.size(), before.weights()), setup), before.targets()};
        pool.train(all);
        return report_result(args, data, all, &before);
    }
    dsgd::board all{orders_for(sgd::divide(data.size(), std::vector<double>(shards, 1)), setup), targets};
    pool.train(all);
    return report_result(args, data, all);
}

} // namespace

int main(int argc, char** argv) {
    tool::check_output_at_exit("cles-dsgd", 5);
    arguments args;
    CLI::App app{"Distributed stochastic gradient descent: delegates shards of a data set, and averages.", "cles-dsgd"};
    app.footer("Exit codes: 0 ok, 2 usage, 3 no node or no task, 4 deadline, 5 another error, 6 busy, "
               "7 a result that is not good.");
    auto* shards = app.add_option("-k,--shards", args.shards,
                                  "Number of shards, or with -r of those at one time (4; with -w or -r at least the "
                                  "number of nodes)")
                       ->check(CLI::Range(1, 1024));
    auto* at = app.add_option("--at", args.seeds, "A node that knows the others (tcp://127.0.0.1:25370)")
                   ->type_name("URL")
                   ->check(dsgd::wrong_url);
    auto* nodes = app.add_option("-n,--nodes", args.nodes, "The nodes that train, in turn (default any)");
    nodes->delimiter(',');
    auto* weighted =
        app.add_flag("-w,--weighted", args.weighted, "Measure the nodes first; faster ones get larger shards");
    auto* resplit =
        app.add_flag("-r,--resplit", args.resplit, "Divide what is left while the nodes work, by how fast they are")
            ->excludes(weighted);
    auto* local =
        app.add_option("--local", args.threads, "Train here, in this number of threads")->check(CLI::Range(1, 1024));
    app.add_option("-e,--epochs", args.epochs, "Steps for each point (100)")->check(CLI::Range(1, 1'000'000));
    app.add_option("--rate", args.rate, "Size of a step (0.0001)")->check(dsgd::wrong_rate);
    app.add_option("--seed", args.seed, "Seed of the random numbers (1)")->check(CLI::NonNegativeNumber);
    auto* deadline = app.add_option("--deadline", args.deadline_s, "Deadline of a shard in seconds (60)")
                         ->check(CLI::Range(1, 86'400));
    for (auto* of_nodes : {shards, at, nodes, weighted, resplit, deadline}) {
        local->excludes(of_nodes);
    }
    app.add_flag("--json", args.json, "Print a JSON object, and no progress");
    std::function<int()> chosen; // a command
    dsgd::add_rounds_command(app, chosen);
    dsgd::add_neighbours_command(app, chosen);
    try {
        app.parse(argc, argv);
        if (chosen) {
            return chosen();
        }
        const sgd::order setup{.epochs = args.epochs, .rate = args.rate, .seed = args.seed, .data = sgd::recipe{}};
        return args.threads != 0 ? run_local(args, setup) : run(args, setup);
    } catch (const CLI::ParseError& error) { // or --help
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const cles::error& e) {
        return report_failure(e);
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles-dsgd: %s\n", e.what());
        return 5;
    }
}
