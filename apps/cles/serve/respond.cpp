// SPDX-License-Identifier: BSL-1.0
#include <cles/json_writer.hpp>
#include <cles/registrar.hpp>
#include <cles/verb.hpp>

#include "commands.hpp"
#include "options/arguments.hpp"
#include "output/errors.hpp"
#include "serve/command_runner.hpp"
#include "serve/command_words.hpp"
#include "serve/node_arguments.hpp"
#include "serve/node_host.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {
namespace {

struct respond_arguments {
    node_arguments node{defaults_beside_others()};
    std::string verb{};
    std::string task{};
    std::optional<std::string> body{};
    std::vector<std::string> command{}; // the words of --exec; empty: none
    std::size_t jobs = 1;
    bool takes_parameters = false;
};

cles::registration fixed_answer(const cles::verb verb, const std::string& task, std::string body) {
    cles::registration made{.verb = verb, .task = task};
    made.info.description = "Always answers the same";
    made.info.idempotent = true;
    made.plain = [body = std::move(body)](const cles::request&, cles::json_writer& w) { w.raw(body); };
    return made;
}

cles::registration answer_by(const std::shared_ptr<command_runner>& runner, const cles::verb verb,
                             const std::string& task) {
    cles::registration made{.verb = verb, .task = task};
    made.info.description = "Answered by a command";
    made.async = [runner](const cles::request& what, const cles::responder& to) { runner->answer(what, to); };
    return made;
}

int respond(const respond_arguments& args, int verbosity) {
    const auto verb = cles::verb_from(args.verb);
    if (!verb || *verb == cles::verb::bind) {
        throw usage_error("'" + args.verb +
                          "': only pull, push, delegate and update are answered; 'cles publish' is "
                          "what others bind");
    }
    if (!is_name(args.task)) {
        throw usage_error("'" + args.task + "' is not the name of a task: 1 to 64 letters, digits, '_', '-', '.'");
    }
    if (args.takes_parameters && args.command.empty()) {
        throw usage_error("--parameters is for --exec");
    }
    if (args.body.has_value() != args.command.empty()) {
        throw usage_error("what is the answer? Give either --data or --exec");
    }
    const auto body = args.body ? read_body(*args.body) : std::string{};
    node_host host{args.node, verbosity};
    const auto runner = std::make_shared<command_runner>(
        host.context(),
        command_runner::settings{
            .words = args.command, .at_once = args.jobs, .takes_parameters = args.takes_parameters},
        [&host](cles::log_level level, const std::string& text) { host.log(level, text); });
    host.node().add(args.body ? fixed_answer(*verb, args.task, body) : answer_by(runner, *verb, args.task));
    return host.run([&runner] { runner->stop(); });
}

} // namespace

void add_respond(CLI::App& app, context& shared) {
    auto args = std::make_shared<respond_arguments>();
    auto* command = app.add_subcommand("respond", "Be a node that answers the requests of a task");
    command->add_option("verb", args->verb, "pull, push, delegate or update")
        ->required()
        ->type_name("")
        ->check(CLI::IsMember({"pull", "push", "delegate", "update"}, CLI::ignore_case).description(""));
    command->add_option("task", args->task, "The name of the task")->required()->type_name("");
    command->add_option("-d,--data", args->body, "The answer: JSON, @FILE, or - for stdin")->type_name("JSON");
    command
        ->add_option_function<std::string>(
            "--exec", [args = args.get()](const std::string& text) { args->command = words_of_command(text); },
            "A command, run without a shell for each request, that prints the answer")
        ->type_name("COMMAND");
    command->add_flag("--parameters", args->takes_parameters,
                      "Requests may have parameters: they are the command's last arguments, after '--'");
    command->add_option("--jobs", args->jobs, "How many commands may run at once; more requests wait (default 1)")
        ->type_name("N")
        ->check(CLI::Range(1, 1024).description(""));
    args->node.add_to(*command);
    command->footer(
        "The command gets the body on stdin. What it prints is the result, as JSON. Its exit code is the outcome: 0 "
        "ok, 2 bad_request, 3 no_task,\n"
        "4 deadline, 6 busy, 69 unavailable, 77 denied, any other failed; what it prints first is then the\n"
        "message. It is stopped when its request is cancelled, or its time is over.\n\n"
        "Examples:\n"
        "  cles respond pull speed -d '{\"value\":27.8}' --name car1\n"
        "  cles respond delegate plan --exec ./plan.py --jobs 4 --name sat1\n"
        "  cles respond push target --exec 'jq -c .lat' --keys /etc/cles/car1");
    command->callback([args, &shared] { shared.exit_code = respond(*args, shared.verbosity); });
}

} // namespace tool
