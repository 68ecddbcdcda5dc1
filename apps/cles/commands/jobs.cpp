// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "options/addresses.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/errors.hpp"
#include "output/json_node.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

struct jobs_arguments {
    address_book addresses{};
    std::string node{};
    std::string noun{}; // of its jobs; empty: those of all nodes
    std::optional<std::uint64_t> cancelled{};
    std::optional<std::chrono::milliseconds> timeout{};
    output_format format = output_format::automatic;
};

/// What a node has answered.
struct node_jobs {
    std::string node;
    std::string jobs{};  ///< its answer, as JSON; empty if it has none
    std::string error{}; ///< why
};

template <class T>
std::optional<T> number_of(const json_node& job, std::string_view name) {
    const auto* const found = job.find(name);
    T value{};
    if (found == nullptr || found->kind != json_node::type::other) {
        return std::nullopt;
    }
    const auto* const end = found->text.data() + found->text.size();
    const auto [rest, code] = std::from_chars(found->text.data(), end, value);
    return code == std::errc{} && rest == end ? std::optional{value} : std::nullopt;
}

std::string span_of(const json_node& job, std::string_view name) {
    const auto ms = number_of<std::int64_t>(job, name);
    return ms ? to_text(std::chrono::milliseconds{*ms}) : "-";
}

std::string progress_of(const json_node& job) {
    const auto fraction = number_of<double>(job, "progress");
    return fraction ? std::to_string(std::lround(*fraction * 100)) + "%" : "-";
}

// `node`: for the first column; null: there is none.
void append_job(table& out, const json_node& job, const std::string* node) {
    out.row();
    std::size_t column = 0;
    if (node != nullptr) {
        out.set(column++, printable(*node));
    }
    for (const std::string_view name : {"job", "state", "verb", "task", "requester"}) {
        const auto* const found = job.find(name);
        out.set(column++, found == nullptr ? "-" : printable(found->text), name == "job");
    }
    out.set(column++, span_of(job, "age_ms"));
    out.set(column++, span_of(job, "deadline_ms"));
    out.set(column, progress_of(job), true);
}

void append_jobs(table& out, const std::string& answer, const std::string* node) {
    const auto document = parse_json(answer);
    const auto* const jobs = document.find("jobs");
    if (jobs == nullptr) {
        throw cles::error(cles::errc::conversion, "the reply contains no jobs");
    }
    for (const auto& job : jobs->elements) {
        append_job(out, job, node);
    }
    if (document.find("more") != nullptr) {
        note((node == nullptr ? std::string{} : printable(*node) + ": ") + "there are more jobs than fit into a reply");
    }
}

std::string all_jobs_table(const std::vector<node_jobs>& nodes) {
    table out{"NODE", "JOB", "STATE", "VERB", "TASK", "REQUESTER", "AGE", "LEFT", "PROGRESS"};
    for (const auto& each : nodes) {
        if (each.error.empty()) {
            append_jobs(out, each.jobs, &each.node);
        } else {
            note(each.node + ": " + each.error);
        }
    }
    return out.text();
}

// The array of jobs in an answer.
std::string jobs_in(const std::string& answer) {
    cles::json_reader reader{answer};
    std::string_view key;
    std::string_view found;
    if (reader.begin_object()) {
        while (reader.next_key(key)) {
            if (key == "jobs" ? !reader.read_raw(found) : !reader.skip()) {
                break;
            }
        }
    }
    std::string out;
    cles::append_compact_json(reader.ok() && found.starts_with('[') ? found : "[]", out);
    return out;
}

std::string all_jobs_json(const std::vector<node_jobs>& nodes) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("nodes");
    w.begin_array();
    for (const auto& each : nodes) {
        w.begin_object();
        w.key("node");
        w.value(std::string_view{each.node});
        if (each.error.empty()) {
            w.key("jobs");
            w.raw(jobs_in(each.jobs));
        } else {
            w.key("failure");
            w.value(std::string_view{each.error});
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

asio::awaitable<void> list_all_jobs(client& requester, const jobs_arguments& args) {
    const auto until = std::chrono::steady_clock::now() + discovery_time;
    const auto found = co_await find_nodes(requester, args.addresses, until, args.timeout);
    auto urls = urls_of(found);
    auto answers = co_await ask_all(requester, "self:cles/jobs", std::move(urls), args.timeout.value_or(2s));
    std::vector<node_jobs> nodes;
    for (std::size_t i = 0; i < found.size(); ++i) {
        const bool lists_none = answers[i].code == cles::errc::no_task;
        if (!lists_none) {
            nodes.push_back(
                {.node = found[i].node, .jobs = std::move(answers[i].json), .error = std::move(answers[i].error)});
        }
    }
    if (resolved(args.format) == output_format::table) {
        write_output(all_jobs_table(nodes));
    } else {
        printer{args.format, false}.print(all_jobs_json(nodes));
    }
}

asio::awaitable<void> list_jobs(client& requester, const jobs_arguments& args) {
    const auto options = requester.options_for(args.noun, args.timeout);
    const cles::json_text answer = co_await requester.node().async_pull(args.noun, options);
    if (resolved(args.format) != output_format::table) {
        printer{args.format, false}.print(answer.text);
        co_return;
    }
    table out{"JOB", "STATE", "VERB", "TASK", "REQUESTER", "AGE", "LEFT", "PROGRESS"};
    append_jobs(out, answer.text, nullptr);
    write_output(out.text());
}

asio::awaitable<void> cancel_job(client& requester, const jobs_arguments& args) {
    const auto options = requester.options_for(args.noun, args.timeout);
    const auto command = "PUSH " + args.noun + "/" + std::to_string(*args.cancelled) + "/cancel";
    co_await requester.node().async_request(command, options);
}

int run_jobs(jobs_arguments& args, int verbosity) {
    if (args.node.empty()) {
        if (args.cancelled) {
            throw usage_error("--cancel needs the node whose job it is, as in 'cles jobs car1 --cancel 17'");
        }
        args.addresses.check_discovery();
    } else if (args.node == "any" || args.node == "all") {
        throw usage_error("'" + args.node + "' is no node: without one, the jobs of all nodes are listed");
    } else {
        args.noun = args.addresses.use_target(args.node) + "/jobs";
    }
    client requester{args.addresses, verbosity};
    requester.explain_failures_of(args.noun);
    return requester.run(args.noun.empty() ? list_all_jobs(requester, args)
                         : args.cancelled  ? cancel_job(requester, args)
                                           : list_jobs(requester, args));
}

} // namespace

void add_jobs(CLI::App& app, context& shared) {
    auto args = std::make_shared<jobs_arguments>();
    auto* command = app.add_subcommand("jobs", "List the jobs of nodes, or cancel one");
    command->add_option("node", args->node, "The name of a node, or a URL (default: all nodes)")->type_name("");
    command->add_option("--cancel", args->cancelled, "Cancel the job with this number, instead of listing them")
        ->type_name("JOB");
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, "5s, 2s for all nodes");
    add_output_option(*command, args->format);
    command->footer(
        "A job is a request that a node has received and not finished. AGE is the time since it began, LEFT\n"
        "the time until its deadline. With security, cancelling needs the right to push cles/jobs/*/cancel;\n"
        "without it, only the host of the node may.\n\n"
        "Examples:\n"
        "  cles jobs\n"
        "  cles jobs sat1 -o json | jq '.jobs[] | select(.state == \"queued\")'\n"
        "  cles jobs sat1 --cancel 17");
    command->callback([args, &shared] { shared.exit_code = run_jobs(*args, shared.verbosity); });
}

} // namespace tool
