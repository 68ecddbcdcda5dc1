// SPDX-License-Identifier: BSL-1.0
#include "pool.hpp"
#include "sgd/parallel.hpp"

#include <CLI/CLI.hpp>

#include <cstdio>

namespace {

struct wishes {
    std::size_t shards = 4, threads = 0;
    std::vector<std::string> seeds{"tcp://127.0.0.1:25370"}, nodes{};
    std::uint64_t epochs = 100, seed = 1, deadline_s = 60;
    double rate = 1e-4;
    bool weighted = false, json = false;
};

struct report {
    std::string error{};
    double trial_ms = 0;
    sgd::times times{};
    sgd::classifier result{};
    sgd::quality quality{};
    std::vector<dsgd::entry> shards{};
    std::vector<sgd::trained> parts{};
};
BOOST_DESCRIBE_STRUCT(report, (), (error, trial_ms, times, result, quality, shards, parts))

int report_failure(const cles::error& why) {
    const auto code = why.code();
    std::fprintf(stderr, "cles-dsgd: %s\n", why.message().c_str());
    const bool missing = code == cles::errc::no_target || code == cles::errc::no_task;
    return missing ? 3 : code == cles::errc::deadline ? 4 : code == cles::errc::busy ? 6 : 5;
}

int tell(const wishes& wanted, const sgd::data_set& data, const dsgd::board& all, double trial_ms = 0) {
    report out{.trial_ms = trial_ms, .shards = all.shards(), .parts = all.parts()};
    if (all.failure()) {
        out.error = all.failure()->message();
    } else {
        out.times = times_of(out.parts);
        out.result = average(out.parts);
        out.quality = judge(data, out.result);
    }
    if (wanted.json) {
        std::puts(cles::to_json(out).c_str());
        return all.failure() ? report_failure(*all.failure()) : 0;
    }
    for (std::size_t i = 0; i < out.parts.size(); ++i) {
        std::printf("%-9s %7ju points  %9.3f ms  %s\n", out.shards[i].fate.c_str(),
                    std::uintmax_t{out.shards[i].what.count}, out.parts[i].ms, out.parts[i].node.c_str());
    }
    if (all.failure()) {
        return report_failure(*all.failure());
    }
    std::printf("elapsed   %.3f ms: the longest shard %.3f, all else %.3f\n"
                "mse       %.7f; no line has less than %.7f; %.4f %% of the points in the wrong class\n",
                out.times.elapsed_ms, out.times.longest_ms, out.times.overhead_ms, out.quality.mse,
                out.quality.least_mse, out.quality.wrong * 100);
    return 0;
}

int run_here(const wishes& wanted, const sgd::order& like) {
    const sgd::data_set data{*like.data};
    const auto orders = orders_for(sgd::divide(data.size(), std::vector<double>(wanted.threads, 1)), like);
    dsgd::board all{orders, {"here"}};
    for (std::size_t i = 0; const auto& part : train_here(data, orders)) {
        all.done(i++, part);
    }
    return tell(wanted, data, all);
}

int run(const wishes& wanted, sgd::order like) {
    dsgd::pool pool{wanted.seeds, std::chrono::seconds{wanted.deadline_s}, !wanted.json};
    auto targets = wanted.nodes;
    const auto offered = pool.find();
    for (const auto& [node, data] : offered) {
        if (wanted.nodes.empty() && wanted.weighted) {
            targets.push_back(node);
        }
        like.data = data; // a node whose data is other will refuse
    }
    for (const auto& node : targets) {
        if (!offered.contains(node)) {
            throw cles::error(cles::errc::no_target, "'" + node + "' does not offer 'sgd': see cles ls --tasks");
        }
    }
    const sgd::data_set data{*like.data};
    std::vector<double> weights(wanted.shards, 1);
    double trial_ms = 0;
    if (wanted.weighted) {
        auto few = like;
        few.epochs = std::max<std::uint64_t>(1, wanted.epochs / 10);
        dsgd::board trial{orders_for(sgd::divide(data.size(), weights), few), targets};
        pool.train(trial);
        if (trial.failure()) {
            return tell(wanted, data, trial);
        }
        targets = nodes_of(trial.parts()); // where each was done, should a node have been lost
        trial_ms = times_of(trial.parts()).elapsed_ms;
        weights = speeds(trial.parts());
    }
    dsgd::board all{orders_for(sgd::divide(data.size(), weights), like), targets};
    pool.train(all);
    return tell(wanted, data, all, trial_ms);
}

} // namespace

int main(int argc, char** argv) {
    wishes wanted;
    CLI::App app{"Distributed stochastic gradient descent: delegates shards of a data set, and averages.", "cles-dsgd"};
    app.footer("Exit codes: 0 ok, 2 usage, 3 no node or no task, 4 deadline, 5 another error, 6 busy.");
    app.add_option("-k,--shards", wanted.shards, "Into how many the data is divided (4)")->check(CLI::Range(1, 1024));
    app.add_option("--at", wanted.seeds, "Who is asked for the nodes (tcp://127.0.0.1:25370)")->type_name("URL");
    app.add_option("-n,--nodes", wanted.nodes, "Who trains, in turns; any unless said")->delimiter(',');
    app.add_flag("-w,--weighted", wanted.weighted, "Measure the nodes first; who is fast has larger shards");
    app.add_option("--local", wanted.threads, "Train here, in so many threads; ask nobody")->check(CLI::Range(1, 1024));
    app.add_option("-e,--epochs", wanted.epochs, "Steps for each point (100)")->check(CLI::Range(1, 1'000'000));
    app.add_option("--rate", wanted.rate, "Size of a step (0.0001)")->check(CLI::PositiveNumber);
    app.add_option("--seed", wanted.seed, "Of the draws (1)");
    app.add_option("--deadline", wanted.deadline_s, "Of a shard, in seconds (60)")->check(CLI::Range(1, 86'400));
    app.add_flag("--json", wanted.json, "Print an object, and no progress");
    try {
        app.parse(argc, argv);
        const sgd::order like{.epochs = wanted.epochs, .rate = wanted.rate, .seed = wanted.seed, .data = sgd::recipe{}};
        return wanted.threads != 0 ? run_here(wanted, like) : run(wanted, like);
    } catch (const CLI::ParseError& wrong) { // or --help
        return app.exit(wrong) == 0 ? 0 : 2;
    } catch (const cles::error& e) {
        return report_failure(e);
    }
}
