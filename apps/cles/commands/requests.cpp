// SPDX-License-Identifier: BSL-1.0
// The verbs that are answered once: pull, push, delegate, update.

#include <cles/verb.hpp>

#include "client/client.hpp"
#include "client/line_answers.hpp"
#include "client/routed_request.hpp"
#include "client/stdin_lines.hpp"
#include "client/told_types.hpp"
#include "commands.hpp"
#include "discovery/find_nodes.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/progress_line.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
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
    bool unchecked = false;
    bool lines = false;
    std::uint32_t hops = 8;
};

// Whether the node is asked for the type of the body before: if somebody wrote one, and it is one node.
bool is_checked(const request_arguments& args) {
    const auto target = target_of(args.noun);
    return (args.body || args.lines) && !args.unchecked && target != "any" && target != "all";
}

// As long as the check may take: the request may still be in time.
std::chrono::milliseconds time_to_check(const request_arguments& args) {
    constexpr std::chrono::milliseconds most{1000};
    return args.timeout ? std::min(*args.timeout, most) : most;
}

std::string does_not_fit(const std::string& noun, const std::string& why) {
    return "the body does not fit " + noun + ": " + why + " ('cles info " + noun +
           "' shows what it takes; --no-check sends it nevertheless)";
}

/// Sends the requests of one command.
class request_sender {
  public:
    request_sender(client& requester, const request_arguments& args)
        : requester_(requester), args_(args), options_(requester.options_for(args.noun, args.timeout)),
          out_(args.format, args.count != 1 || args.lines), progress_(args.progress) {
        options_.urgent(args.urgent).hops(args.hops);
        if (args.verb == cles::verb::delegate && progress_.is_wanted()) {
            options_.on_progress(
                [this](double fraction, std::string_view details) { progress_.show(fraction, details); });
        }
    }
    request_sender(const request_sender&) = delete;
    request_sender& operator=(const request_sender&) = delete;

    /// The same body, as often as was asked for.
    asio::awaitable<void> send_body(std::string body) {
        co_await prepare();
        if (const auto why = body_mismatch(schema_, body); !why.empty()) {
            throw usage_error(does_not_fit(args_.noun, why));
        }
        auto next = std::chrono::steady_clock::now();
        for (std::uint64_t i = 0; args_.count == 0 || i < args_.count; ++i) {
            if (i > 0 && args_.interval.count() > 0) {
                next += args_.interval;
                co_await requester_.sleep_until(next);
            }
            co_await send(body);
        }
    }

    /// The body in each line of stdin: the answer of one is printed before the next is sent.
    asio::awaitable<void> send_lines() {
        stdin_lines lines{requester_.context()};
        line_answers answers;
        co_await prepare();
        for (;;) {
            const std::optional<std::string> line = co_await lines.next();
            if (!line) {
                break;
            }
            const auto body = answers.take(lines.number(), *line);
            if (body) {
                co_await send_line(*body, answers);
            }
            if (!answers.failure().empty()) {
                out_.print(answers.failure());
            }
        }
        if (answers.first_failure()) {
            std::rethrow_exception(answers.first_failure());
        }
    }

  private:
    // Finds a node that routes, and asks for the type of the body, where that is needed.
    asio::awaitable<void> prepare() {
        if (needs_router(args_.addresses, args_.noun)) {
            auto found = co_await possible_routers(requester_, args_.addresses);
            routers_ = std::move(found);
        }
        if (is_checked(args_)) {
            auto asking = requester_.options_for(args_.noun, time_to_check(args_));
            asking.hops(args_.hops);
            auto told = co_await ask_for_body_schema(requester_, args_.verb, args_.noun, asking, routers_);
            schema_ = std::move(told);
        }
    }

    asio::awaitable<void> send(std::string body) {
        std::string command{to_string(args_.verb)};
        command.append(" ").append(args_.noun);
        if (!body.empty()) {
            command.append(" ").append(body);
        }
        const cles::json_text answer = co_await send_routed(requester_, command, options_, routers_);
        progress_.clear();
        out_.print(answer.text);
    }

    // A node that cannot be reached ends the command, and so does its interruption.
    asio::awaitable<void> send_line(std::string body, line_answers& answers) {
        if (const auto why = body_mismatch(schema_, body); !why.empty()) {
            answers.refuse(does_not_fit(args_.noun, why));
            co_return;
        }
        try {
            co_await send(std::move(body));
        } catch (const cles::error& e) {
            if (requester_.is_ending() || e.code().category() != cles::error_category()) {
                throw;
            }
            progress_.clear();
            answers.fail(static_cast<cles::errc>(e.code().value()), e.message());
        }
    }

    client& requester_;
    const request_arguments& args_;
    cles::call_options options_;
    printer out_;
    progress_line progress_;
    std::vector<std::string> routers_;
    std::string schema_; // of the body; empty: not known, or not to be checked
};

// The sender ends with the coroutine, so that its progress is erased before a failure is reported.
asio::awaitable<void> send_requests(client& requester, const request_arguments& args, std::string body) {
    request_sender sender{requester, args};
    if (args.lines) {
        co_await sender.send_lines();
    } else {
        co_await sender.send_body(std::move(body));
    }
}

int run_request(const request_arguments& args, int verbosity) {
    check_noun(args.noun);
    if (args.lines && (args.body || args.count != 1)) {
        throw usage_error("--lines cannot be combined with --data or --count: each line of stdin is a body");
    }
    auto body = args.body ? read_body(*args.body) : std::string{};
    client requester{args.addresses, verbosity};
    requester.explain_failures_of(args.noun);
    return requester.run(send_requests(requester, args, std::move(body)));
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
        command->add_flag("--lines", args->lines,
                          "Send a request for each line of stdin, which is its body, and print a line for each");
        command->add_flag("--no-check", args->unchecked, "Send the body without asking the node for its type first");
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
                "  jq -n '{speed:27.8}' | cles push car1:echo -d -\n"
                "  jq -c '.[]' orders.json | cles push car1:echo --lines");
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
