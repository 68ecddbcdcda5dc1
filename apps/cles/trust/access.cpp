// SPDX-License-Identifier: BSL-1.0
#include <cles/json_writer.hpp>
#include <cles/security/access.hpp>
#include <cles/security/core_dumps.hpp>

#include "commands.hpp"
#include "options/arguments.hpp"
#include "options/keys_option.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace tool {

namespace security = cles::security;

namespace {

struct access_arguments {
    keys_option keys;
    std::string peer;
    std::string via;
    std::string verb;
    std::string noun;
    bool json = false;
};

std::string answer_text(const security::access_answer& answer) {
    std::string out = answer.allowed ? "allowed\n" : "denied\n";
    for (const auto& line : answer.lines) {
        out.append("  ").append(printable(line)).append("\n");
    }
    return out;
}

std::string answer_json(const security::access_answer& answer) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("allowed");
    w.value(answer.allowed);
    w.key("reason");
    w.value(std::string_view{answer.reason});
    w.key("lines");
    w.begin_array();
    for (const auto& line : answer.lines) {
        w.value(std::string_view{line});
    }
    w.end_array();
    w.end_object();
    return out + "\n";
}

int explain(const access_arguments& args) {
    check_noun(args.noun);
    for (const auto& name : {args.peer, args.via}) {
        if (!name.empty() && !is_name(name)) {
            throw usage_error("'" + name + "' is not the name of a node");
        }
    }
    if (const auto target = target_of(args.noun); target == "any" || target == "all") {
        throw usage_error("'" + args.noun + "': name the node that serves; any and all choose among permitted ones");
    }
    const auto answer = security::explain_access(args.keys.directory(), {.requester = args.peer,
                                                                         .forwarder = args.via,
                                                                         .asked = cles::verb_from(args.verb).value(),
                                                                         .noun = args.noun});
    write_output(args.json ? answer_json(answer) : answer_text(answer));
    for (const auto& warning : answer.warnings) {
        note(warning);
    }
    return answer.allowed ? exit_code::success : exit_code::remote_error;
}

} // namespace

void add_access(CLI::App& app, context& shared) {
    auto args = std::make_shared<access_arguments>();
    auto* command = app.add_subcommand("access", "Explain whether a member may send a request, and which line decides");
    command->add_option("peer", args->peer, "The member that sends the request")->required()->type_name("MEMBER");
    command->add_option("verb", args->verb, "pull, push, delegate, bind (also of the updates that follow) or update")
        ->required()
        ->type_name("")
        ->check(CLI::IsMember({"pull", "push", "delegate", "bind", "update"}, CLI::ignore_case).description(""));
    command->add_option("noun", args->noun, "NODE:TASK or NODE:TASK/PARAMETER..., where self is the node of --keys")
        ->required()
        ->type_name("MEMBER:TASK");
    command->add_option("--via", args->via, "The member that forwards the request")->type_name("MEMBER");
    args->keys.add_to(*command, "The directory of the node that decides, or the authority's");
    add_json_option(*command, args->json, "one document");
    command->footer(
        "Rules are those of the directory. If the request is the node's own, rules with 'may' do not apply.\n"
        "The exit code is 0 if the request is allowed, and 5 if it is denied.\n\n"
        "Examples:\n"
        "  cles access sat1 push car1:target\n"
        "  cles access car2 bind self:localization --via relay -o json");
    command->callback([args, &shared] {
        security::forbid_core_dumps();
        shared.exit_code = explain(*args);
    });
}

} // namespace tool
