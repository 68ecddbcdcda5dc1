// SPDX-License-Identifier: BSL-1.0
#include "rounds_command.hpp"

#include "digits/descent.hpp"
#include "dsgd/check_arguments.hpp"
#include "trainers.hpp"
#include "training_arguments.hpp"
#include "training_report.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <memory>

namespace dsgd {
namespace {

struct rounds_arguments {
    std::vector<std::string> seeds{"tcp://127.0.0.1:25370"}, nodes{}, local{};
    std::uint64_t deadline_s = 60;
    training_arguments training{};
};

// One thread without CLES: what rounds are to be measured by. The time of evaluations does not count.
int train_here(const rounds_arguments& args, const digits::image_set& test) {
    const auto images = digits::image_set::read(args.local);
    test.check_kind(images);
    const auto& training = args.training;
    auto network = training.start(test);
    training_report report{test, training.rounds, training.evaluate, training.best, training.json};
    std::chrono::duration<double, std::milli> spent{0};
    for (std::uint64_t round = 1; round <= training.rounds; ++round) {
        round_result ended{.round = round, .nodes = {"here"}, .images = training.how.passes * images.size()};
        ended.began_ms = spent.count();
        const auto begun = std::chrono::steady_clock::now();
        auto how = training.how;
        how.seed += round - 1;
        digits::descent work{images, std::move(network), how};
        while (work.step()) {
        }
        network = work.result();
        spent += std::chrono::steady_clock::now() - begun;
        if (work.diverged()) {
            throw cles::error(cles::errc::failed, digits::diverged);
        }
        ended.loss = work.mean_loss();
        ended.ended_ms = spent.count();
        report.add(ended, network);
    }
    return report.finish({}, 0);
}

int train_in_rounds(const rounds_arguments& args) {
    const auto test = digits::image_set::read({args.training.test});
    if (!args.local.empty()) {
        return train_here(args, test);
    }
    trainers nodes{args.seeds, args.nodes, std::chrono::seconds{args.deadline_s}};
    nodes.find(test.header().pixels, test.header().classes);
    const auto& training = args.training;
    round_plan plan{training.start(test), training.rounds};
    training_report report{test, training.rounds, training.evaluate, training.best, training.json};
    const auto bytes =
        nodes.run(plan, {.passes = training.how.passes, .rate = training.how.rate, .seed = training.how.seed},
                  [&](const round_result& ended) { report.add(ended, plan.present()); });
    return report.finish(plan.failure(), bytes);
}

} // namespace

void add_rounds_command(CLI::App& to, std::function<int()>& chosen) {
    const auto args = std::make_shared<rounds_arguments>();
    auto* command = to.add_subcommand(
        "rounds", "Trains a network on images that stay in the files of their nodes: averages what they have learned, "
                  "round by round");
    auto* at = command->add_option("--at", args->seeds, "A node that knows the others (tcp://127.0.0.1:25370)")
                   ->type_name("URL")
                   ->check(wrong_url);
    auto* nodes = command->add_option("-n,--nodes", args->nodes, "The nodes that train (all that offer the task)");
    nodes->delimiter(',');
    auto* local = command->add_option("--local", args->local, "Train here, in one thread, on the images of these files")
                      ->type_name("FILE");
    local->delimiter(',');
    args->training.add_options(*command, "Seed of the random numbers (1)");
    auto* deadline =
        command->add_option("--deadline", args->deadline_s, "Deadline of a node in a round in seconds (60)")
            ->check(CLI::Range(1, 86'400));
    for (auto* of_nodes : {at, nodes, deadline}) {
        local->excludes(of_nodes);
    }
    command->final_callback([args, &chosen] { chosen = [args] { return train_in_rounds(*args); }; });
}

} // namespace dsgd
