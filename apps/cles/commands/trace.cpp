// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/verb.hpp>

#include "client/client.hpp"
#include "client/routed_request.hpp"
#include "commands.hpp"
#include "commands/trace_tree.hpp"
#include "discovery/find_nodes.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/statistics.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;
using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

constexpr auto patience = 1s;         // with each node that is asked for its spans
constexpr std::size_t max_nodes = 64; // that are asked
constexpr double us_per_s = 1e6;

struct trace_arguments {
    address_book addresses;
    std::string verb;
    std::string noun;
    std::optional<std::string> body;
    std::optional<std::chrono::milliseconds> timeout;
    bool json = false;
};

/// What is printed with `-o json`.
struct traced_request {
    std::string trace;
    std::string outcome;
    hop request; ///< the command, and below it the nodes
};
BOOST_DESCRIBE_STRUCT(traced_request, (), (trace, outcome, request))

/// That many random hex digits, not all 0.
std::string random_hex(std::size_t digits) {
    std::random_device random;
    std::uniform_int_distribution<std::size_t> digit{0, 15};
    std::string text;
    while (text.find_first_not_of('0') == std::string::npos) {
        text.clear();
        std::generate_n(std::back_inserter(text), digits, [&] { return "0123456789abcdef"[digit(random)]; });
    }
    return text;
}

class tracer {
  public:
    tracer(client& requester, const trace_arguments& args)
        : requester_(requester), args_(args), options_(requester.options_for(args.noun, args.timeout)),
          target_(target_of(args.noun)) {
        options_.trace("00-" + trace_ + "-" + span_ + "-01");
    }
    tracer(const tracer&) = delete;
    tracer& operator=(const tracer&) = delete;

    asio::awaitable<void> run(std::string command) {
        std::vector<std::string> routers;
        if (needs_router(args_.addresses, args_.noun)) {
            auto found = co_await possible_routers(requester_, args_.addresses);
            routers = std::move(found);
        } else { // so that the time does not include finding the node and opening the link
            co_await ask(first_noun(), options_.at_);
            failure_.clear();
        }
        hop request{.node = "cles", .request = command.substr(0, command.find(' ', command.find(' ') + 1))};
        const auto begun = steady::now();
        std::exception_ptr thrown;
        try {
            co_await send_routed(requester_, command, options_, routers);
            request.outcome = "ok";
        } catch (const cles::error& e) {
            if (e.code() == cles::errc::cancelled) {
                throw;
            }
            thrown = std::current_exception();
            request.outcome = outcome_of(e);
        }
        request.total_us = std::chrono::duration<double>{steady::now() - begun}.count() * us_per_s;
        co_await collect();
        request.hops = hops_of(nodes_, span_, *request.total_us);
        show(request);
        if (thrown) {
            std::rethrow_exception(thrown);
        }
    }

  private:
    static std::string outcome_of(const cles::error& e) {
        const bool known = e.code().category() == cles::error_category();
        return std::string{
            cles::wire_name(known ? static_cast<cles::errc>(e.code().value()) : cles::errc::unavailable)};
    }

    [[nodiscard]] std::string noun_at(const std::string& node) const { return node + ":cles/trace/" + trace_; }
    /// The spans of the node to which the request is sent.
    [[nodiscard]] std::string first_noun() const { return noun_at(options_.at_.empty() ? target_ : "self"); }

    // Asks one node; `failure_` says why there is no answer.
    asio::awaitable<std::optional<trace_document>> ask(std::string noun, std::string at) {
        cles::call_options options;
        options.at(at, at == options_.at_ ? options_.at_node_ : std::string{});
        options.deadline(patience).diagnostics(failure_);
        try {
            const cles::json_text answer = co_await requester_.node().async_pull(noun, options);
            co_return cles::from_json<trace_document>(answer.text);
        } catch (const cles::error& e) {
            if (e.code() == cles::errc::cancelled) {
                throw;
            }
            failure_ = e.what();
        }
        co_return std::nullopt;
    }

    // First the node that was asked, then those to which it has sent requests, and so on. A node that is not reached
    // directly is asked through the first.
    asio::awaitable<void> collect() {
        auto first = co_await ask(first_noun(), options_.at_);
        if (!first) {
            note("no spans of the first node: " + failure_);
            co_return;
        }
        add(std::move(*first));
        const auto through = options_.at_.empty() ? requester_.endpoint_of(target_) : options_.at_;
        for (std::size_t i = 0; i < names_.size() && i < max_nodes; ++i) {
            const auto name = names_[i];
            if (std::any_of(nodes_.begin(), nodes_.end(), [&](const auto& each) { return each.node == name; })) {
                continue;
            }
            std::optional<trace_document> found;
            if (!through.empty()) {
                auto answer = co_await ask(noun_at(name), through);
                found = std::move(answer);
            }
            if (!found && (args_.addresses.finds_by_name() || through.empty())) {
                auto answer = co_await ask(noun_at(name), {});
                found = std::move(answer);
            }
            if (found) {
                add(std::move(*found));
            } else {
                note("no spans of " + printable(name) + ": " + failure_);
            }
        }
    }

    void add(trace_document node) {
        for (const auto& span : node.spans) {
            if (span.kind == "sent") {
                remember(span.next.value_or(""));
                remember(span.target);
            }
        }
        nodes_.push_back(std::move(node));
    }

    void remember(const std::string& name) {
        const bool is_node = is_name(name) && !stands_for_others(name);
        if (is_node && std::find(names_.begin(), names_.end(), name) == names_.end()) {
            names_.push_back(name);
        }
    }

    void show(const hop& request) const {
        if (args_.json) {
            write_output(cles::to_json(traced_request{trace_, *request.outcome, request}) + "\n");
        } else {
            write_output(bold(stream::out, "trace") + " " + trace_ + "\n" + to_table(request));
        }
    }

    client& requester_;
    const trace_arguments& args_;
    const std::string trace_ = random_hex(32);
    const std::string span_ = random_hex(16);
    cles::call_options options_;
    std::string target_;
    std::string failure_;
    std::vector<trace_document> nodes_;
    std::vector<std::string> names_; // of nodes to ask, in the order in which they became known
};

asio::awaitable<void> trace(client& requester, const trace_arguments& args, std::string command) {
    tracer work{requester, args};
    co_await work.run(std::move(command));
}

int run_trace(const trace_arguments& args, int verbosity) {
    check_noun(args.noun);
    const auto verb = cles::verb_from(args.verb);
    std::string command{to_string(*verb)};
    command.append(" ").append(args.noun);
    if (args.body) {
        if (*verb == cles::verb::pull) {
            throw usage_error("PULL takes no body: -d is for the other verbs");
        }
        command.append(" ").append(read_body(*args.body));
    }
    client requester{args.addresses, verbosity};
    requester.explain_failures_of(args.noun);
    return requester.run(trace(requester, args, std::move(command)));
}

} // namespace

void add_trace(CLI::App& app, context& shared) {
    auto args = std::make_shared<trace_arguments>();
    auto* command = app.add_subcommand("trace", "Show where a request goes, and how long each step takes");
    command->add_option("verb", args->verb, "pull, push, delegate or update")
        ->required()
        ->type_name("")
        ->check(CLI::IsMember({"pull", "push", "delegate", "update"}, CLI::ignore_case).description(""));
    add_noun(*command, args->noun);
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, "5s, delegate 30s");
    command->add_option("-d,--data", args->body, "The body: JSON, @FILE, or - for stdin")->type_name("JSON");
    add_json_option(*command, args->json, "a document with the tree");
    command->footer("Each line is a node that received the request: how long it took there in all, how much longer it\n"
                    "took for the sender (the link), how long it waited for a worker, and how long it ran. The first\n"
                    "line is this command. The time until a connection is open is not counted.\n\n"
                    "Examples:\n"
                    "  cles trace pull car1:localization\n"
                    "  cles trace delegate any:plan -d '{\"area\":7}' --at tcp://10.0.0.7");
    command->callback([args, &shared] { shared.exit_code = run_trace(*args, shared.verbosity); });
}

} // namespace tool
