// SPDX-License-Identifier: BSL-1.0
#include "neighbours_command.hpp"

#include "dsgd/check_arguments.hpp"
#include "dsgd/rounds/training_arguments.hpp"
#include "dsgd/rounds/training_report.hpp"
#include "participant.hpp"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

namespace dsgd {
namespace {

struct neighbours_arguments {
    participant::options node{.listen = "tcp://127.0.0.1:0"};
    std::vector<std::string> files{};
    double patience_s = 10;
    training_arguments training{};
};

int train_with_neighbours(const neighbours_arguments& args) {
    const auto& training = args.training;
    const auto test = digits::image_set::read({training.test});
    const auto images = digits::image_set::read(args.files);
    test.check_kind(images);
    auto wanted = args.node;
    wanted.rounds = training.rounds;
    wanted.how = training.how;
    wanted.patience_ms = args.patience_s * 1000;
    training_report report{test, training.rounds, training.evaluate, training.best, training.json};
    participant node{wanted, images, training.start(test)};
    std::fprintf(training.json ? stderr : stdout, "%s listening on %s\n", wanted.name.c_str(), node.endpoint().c_str());
    std::fflush(stdout);
    const auto bytes =
        node.run([&](const round_result& ended, const digits::network& mean) { report.add(ended, mean); });
    return report.finish({}, bytes);
}

} // namespace

void add_neighbours_command(CLI::App& to, std::function<int()>& chosen) {
    const auto args = std::make_shared<neighbours_arguments>();
    auto& node = args->node;
    auto* command = to.add_subcommand(
        "neighbours", "Is a node that trains a network on images of its own, and averages with its neighbours, without "
                      "a manager");
    command->add_option("--name", node.name, "The name of this node")->required();
    command->add_option("-n,--neighbours", node.neighbours, "The nodes with which it averages; they name it, too")
        ->delimiter(',')
        ->required();
    command->add_option("--files", args->files, "Files with the images of this node")
        ->type_name("FILE")
        ->delimiter(',')
        ->required();
    command->add_option("--listen", node.listen, "Where it listens (tcp://127.0.0.1:0)")
        ->type_name("URL")
        ->check(wrong_url);
    command->add_option("--at", node.seeds, "A node that knows the others; all but one of them need it")
        ->type_name("URL")
        ->check(wrong_url);
    command->add_flag("--insecure", node.insecure, "Listen beyond this host without credentials");
    args->training.add_options(*command, "Seed of the random numbers (1); that of all nodes");
    command
        ->add_option("--patience", args->patience_s,
                     "How long it waits for a neighbour that was never there, in "
                     "seconds (10)")
        ->check(CLI::Range(0.0, 86'400.0));
    command->final_callback([args, &chosen] { chosen = [args] { return train_with_neighbours(*args); }; });
}

} // namespace dsgd
