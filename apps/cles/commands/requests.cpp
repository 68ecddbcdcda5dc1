// SPDX-License-Identifier: BSL-1.0
// The verbs that are answered once: pull, push, delegate, update.

#include <cles/verb.hpp>

#include "client/client.hpp"
#include "client/routed_request.hpp"
#include "commands.hpp"
#include "discovery/find_nodes.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/printer.hpp"
#include "output/progress_line.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct request_arguments {
    cles::verb verb;
    address_book addresses{};
    std::string noun{};
    std::optional<std::string> body{};
    std::optional<std::chrono::milliseconds> timeout{};
    std::uint64_t count = 1;
    std::chrono::milliseconds interval{1000};
    output_format format = output_format::automatic;
    bool progress = false;
    bool urgent = false;
    std::uint32_t hops = 8;
};

asio::awaitable<void> send_all(client& requester, const request_arguments& args, std::string command) {
    printer out{args.format, args.count != 1};
    progress_line progress{args.progress};
    auto options = requester.options_for(args.noun, args.timeout);
    options.urgent(args.urgent).hops(args.hops);
    if (args.verb == cles::verb::delegate && progress.is_wanted()) {
        options.on_progress(
            [&progress](double fraction, std::string_view details) { progress.show(fraction, details); });
    }
    std::vector<std::string> routers;
    if (needs_router(args.addresses, args.noun)) {
        auto found = co_await possible_routers(requester, args.addresses);
        routers = std::move(found);
    }
    auto next = std::chrono::steady_clock::now();
    for (std::uint64_t i = 0; args.count == 0 || i < args.count; ++i) {
        if (i > 0 && args.interval.count() > 0) {
            next += args.interval;
            co_await requester.sleep_until(next);
        }
        const cles::json_text answer = co_await send_routed(requester, command, options, routers);
        progress.clear();
        out.print(answer.text);
    }
}

int run_request(const request_arguments& args, int verbosity) {
    check_noun(args.noun);
    std::string command{to_string(args.verb)};
    command.append(" ").append(args.noun);
    if (args.body) {
        command.append(" ").append(read_body(*args.body));
    }
    client requester{args.addresses, verbosity};
    requester.explain_failures_of(args.noun);
    return requester.run(send_all(requester, args, std::move(command)));
}

void add_request(CLI::App& app, context& shared, cles::verb verb, const std::string& name, const std::string& help,
                 const std::string& examples) {
    auto args = std::make_shared<request_arguments>(request_arguments{.verb = verb});
    auto* command = app.add_subcommand(name, help);
    add_noun(*command, args->noun);
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, verb == cles::verb::delegate ? "30s" : "5s");
    add_count(*command, args->count, "Number of requests; 0: until interrupted (default 1)");
    add_duration(*command, "-i,--interval", args->interval, "Time between requests; 0: no pause (default 1s)");
    add_hops(*command, args->hops);
    add_output_option(*command, args->format);
    if (verb != cles::verb::update) {
        command->add_flag("--urgent", args->urgent, "Have the node send the reply before others that are queued");
    }
    if (verb == cles::verb::pull) {
        refuse_body(*command, "PULL");
    } else {
        command->add_option("-d,--data", args->body, "The body: JSON, @FILE, or - for stdin")->type_name("JSON");
    }
    if (verb == cles::verb::delegate) {
        command->add_flag("--progress", args->progress,
                          "Print progress, one line per report, even if stderr is not a terminal");
    }
    command->footer(examples);
    command->callback([args, &shared] { shared.exit_code = run_request(*args, shared.verbosity); });
}

} // namespace

void add_pull(CLI::App& app, context& shared) {
    add_request(app, shared, cles::verb::pull, "pull", "Get data once",
                "Examples:\n"
                "  cles pull car1:localization\n"
                "  cles pull car1:localization --at tcp://10.0.0.7 -t 500ms\n"
                "  cles pull car1:localization -n 10 -i 100ms -o json | jq .velocity\n"
                "  cles pull self:cles --at unix:///run/car1.sock");
}

void add_push(CLI::App& app, context& shared) {
    add_request(app, shared, cles::verb::push, "push", "Send parameters and data",
                "Examples:\n"
                "  cles push car1:echo -d '{\"speed\":27.8}'\n"
                "  cles push car1:echo -d @order.json\n"
                "  jq -n '{speed:27.8}' | cles push car1:echo -d -");
}

void add_delegate(CLI::App& app, context& shared) {
    add_request(app, shared, cles::verb::delegate, "delegate", "Delegate a task and get its result",
                "Ctrl-C cancels the task.\n\n"
                "Examples:\n"
                "  cles delegate car1:sleep/3000\n"
                "  cles delegate car1:echo -d '{\"samples\":[1,2,3]}' -t 1min");
}

void add_update(CLI::App& app, context& shared) {
    add_request(app, shared, cles::verb::update, "update", "Ask a node to publish an update to all subscribers",
                "Examples:\n"
                "  cles update car1:notice -d '{\"text\":\"bridge closed\"}'\n"
                "  cles bind car1:notice          # in another terminal: receives it");
}

} // namespace tool
