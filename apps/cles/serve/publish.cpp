// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "client/stdin_lines.hpp"
#include "commands.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"
#include "serve/child_process.hpp"
#include "serve/command_outcome.hpp"
#include "serve/command_words.hpp"
#include "serve/node_arguments.hpp"
#include "serve/node_host.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
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

struct publish_arguments {
    node_arguments node{defaults_beside_others()};
    std::string noun{};
    std::optional<std::string> body{};
    std::vector<std::string> command{}; // the words of --exec; empty: none
    std::optional<double> rate{};
    std::uint64_t count = 0;
    bool stays = false;
};

/// Publishes a noun from one of three sources: a body, the lines of stdin, or what a program prints.
class noun_publisher {
  public:
    noun_publisher(node_host& host, const publish_arguments& args)
        : host_(host), args_(args), path_(args.noun.substr(args.noun.find(':') + 1)),
          timer_(host.context(), asio::steady_timer::time_point::max()) {
        host.node().on_bind(path_.substr(0, path_.find('/')), {.description = "Published by a command"});
    }
    noun_publisher(const noun_publisher&) = delete;
    noun_publisher& operator=(const noun_publisher&) = delete;

    asio::awaitable<void> run() {
        if (args_.body) {
            co_await repeat_body();
        } else if (!args_.command.empty()) {
            co_await repeat_command();
        } else {
            co_await publish_lines();
        }
        if (!args_.stays && !stopped_) {
            host_.finish(code_);
        }
    }

    [[nodiscard]] bool is_stopped() const noexcept { return stopped_; }
    void stop() {
        stopped_ = true;
        timer_.cancel();
        if (lines_) {
            lines_->cancel();
        }
        if (process_) {
            process_->kill();
        }
    }

  private:
    asio::awaitable<void> repeat_body() {
        publish(*args_.body);
        if (!args_.rate && args_.count == 0) { // once, and then it can be bound until the node is stopped
            co_await pause_until(asio::steady_timer::time_point::max());
        }
        while (wants_more()) {
            co_await pause();
            if (!stopped_) {
                publish(*args_.body);
            }
        }
    }

    asio::awaitable<void> publish_lines() {
        lines_.emplace(host_.context());
        while (wants_more()) {
            const std::optional<std::string> line = co_await lines_->next();
            if (!line) {
                break;
            }
            if (published_ > 0 && args_.rate) {
                co_await pause();
            }
            if (stopped_) {
                break;
            }
            publish_text(*line, "line " + std::to_string(lines_->number()) + " of stdin");
        }
    }

    asio::awaitable<void> repeat_command() {
        while (wants_more()) {
            const command_outcome outcome = co_await run_command();
            if (stopped_) {
                break;
            }
            if (outcome.failure) {
                report(outcome.text);
            } else {
                publish_text(outcome.text, "what the command has printed");
            }
            co_await pause();
        }
    }

    // The coroutine waits on the timer, which the end of the program cancels.
    asio::awaitable<command_outcome> run_command() {
        command_outcome outcome;
        process_ = child_process::start(host_.context(), args_.command, {}, [&](const finished_command& ended) {
            outcome = outcome_of(ended);
            process_.reset();
            timer_.cancel();
        });
        while (process_) {
            timer_.expires_at(asio::steady_timer::time_point::max());
            boost::system::error_code ended;
            co_await timer_.async_wait(asio::redirect_error(asio::use_awaitable, ended));
        }
        co_return outcome;
    }

    [[nodiscard]] bool wants_more() const { return !stopped_ && (args_.count == 0 || published_ < args_.count); }

    // At fixed times, whatever publishing takes; missed times are skipped.
    asio::awaitable<void> pause() {
        constexpr double usual_rate = 1;
        const std::chrono::nanoseconds period{std::llround(1e9 / args_.rate.value_or(usual_rate))};
        next_ = std::max(next_ + period, std::chrono::steady_clock::now());
        co_await pause_until(next_);
    }

    asio::awaitable<void> pause_until(std::chrono::steady_clock::time_point when) {
        if (!stopped_) {
            timer_.expires_at(when);
            boost::system::error_code ended;
            co_await timer_.async_wait(asio::redirect_error(asio::use_awaitable, ended));
        }
    }

    void publish_text(std::string_view text, const std::string& origin) {
        std::string body;
        try {
            body = checked_body(text, origin);
        } catch (const usage_error& e) {
            code_ = exit_code::usage;
            report(e.what());
            return;
        }
        publish(body);
    }

    void publish(const std::string& body) {
        ++published_;
        try {
            host_.node().update(path_, cles::json_text{body});
        } catch (const cles::error& e) {
            code_ = exit_code::local_failure;
            report(e.what());
        }
    }

    static void report(const std::string& what) { print_error("not published: " + what); }

    node_host& host_;
    const publish_arguments& args_;
    const std::string path_;
    asio::steady_timer timer_;
    std::chrono::steady_clock::time_point next_ = std::chrono::steady_clock::now();
    std::optional<stdin_lines> lines_;
    std::shared_ptr<child_process> process_;
    std::uint64_t published_ = 0;
    int code_ = exit_code::success;
    bool stopped_ = false;
};

int publish(publish_arguments& args, int verbosity) {
    check_noun(args.noun);
    const std::string target{target_of(args.noun)};
    if (target == "any" || target == "all") {
        throw usage_error("'" + args.noun + "': a noun is published by one node: write its name, or self");
    }
    if (args.body && !args.command.empty()) {
        throw usage_error("--data and --exec cannot be combined");
    }
    if (args.body) {
        args.body = read_body(*args.body);
    }
    if (target != "self") {
        args.node.propose_name(target);
    }
    node_host host{args.node, verbosity};
    if (target != "self" && target != host.node().name()) {
        throw usage_error("'" + args.noun + "': the name of this node is " + host.node().name());
    }
    noun_publisher work{host, args};
    std::exception_ptr thrown;
    asio::co_spawn(host.context(), work.run(), [&](std::exception_ptr failure) {
        if (failure && !work.is_stopped()) { // otherwise its wait was cancelled
            thrown = std::move(failure);
            host.stop(exit_code::local_failure);
        }
    });
    const int code = host.run([&work] { work.stop(); });
    return thrown ? report_failure(thrown) : code;
}

} // namespace

void add_publish(CLI::App& app, context& shared) {
    auto args = std::make_shared<publish_arguments>();
    auto* command = app.add_subcommand("publish", "Be a node that publishes a noun");
    add_noun(*command, args->noun, "self, which is the node of --name");
    command->add_option("-d,--data", args->body, "The value: JSON, @FILE, or - for all of stdin")->type_name("JSON");
    command
        ->add_option_function<std::string>(
            "--exec", [args = args.get()](const std::string& text) { args->command = words_of_command(text); },
            "A command, run without a shell, that prints a value each time")
        ->type_name("COMMAND");
    command
        ->add_option("--rate", args->rate,
                     "Updates per second (default: with --data one in all, with --exec one per second, and lines of "
                     "stdin as they come)")
        ->type_name("HZ")
        ->check(CLI::Range(1e-3, 1e6).description(""));
    add_count(*command, args->count, "End after this number of updates; 0: without end (default 0)");
    command->add_flag("--stay", args->stays, "Stay after the last update, so that its value can still be bound");
    args->node.add_to(*command);
    command->footer("Without --data and --exec, each line of stdin is a value, as JSON; the node ends with stdin.\n"
                    "A value that is not valid is reported, and the next one follows. The last value is also sent to\n"
                    "those who bind the noun later.\n\n"
                    "Examples:\n"
                    "  cles publish car1:notice -d '{\"text\":\"road closed\"}'\n"
                    "  jq -c --unbuffered '{speed}' /dev/ttyUSB0 | cles publish car1:speed\n"
                    "  cles publish car1:load --exec ./load.py --rate 2\n"
                    "  cles publish car1:notice --keys /etc/cles/car1 -d @notice.json");
    command->callback([args, &shared] { shared.exit_code = publish(*args, shared.verbosity); });
}

} // namespace tool
