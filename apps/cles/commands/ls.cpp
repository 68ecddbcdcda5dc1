// SPDX-License-Identifier: BSL-1.0
#include <cles/verb.hpp>

#include "client/client.hpp"
#include "client/offered_tasks.hpp"
#include "commands.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "discovery/listed_pool.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"
#include "output/json_node.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

struct ls_arguments {
    address_book addresses;
    std::chrono::milliseconds wait = discovery_time;
    std::optional<std::chrono::milliseconds> timeout;
    bool tasks = false;
    bool pools = false;
    std::string offered;
    output_format format = output_format::automatic;
};

// Asks each node what it offers.
asio::awaitable<void> query_tasks(client& requester, std::vector<listed_node>& nodes, std::chrono::milliseconds limit) {
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles", std::move(urls), limit);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        nodes[i].error = answers[i].error;
        if (nodes[i].error.empty()) {
            nodes[i].read_tasks(answers[i].json);
        }
    }
}

// Asks each node for the pools that it reaches as a bridge.
asio::awaitable<void> show_pools(client& requester, const std::vector<listed_node>& nodes,
                                 std::chrono::milliseconds limit, output_format format) {
    auto urls = urls_of(nodes);
    const auto answers = co_await ask_all(requester, "self:cles/metrics", std::move(urls), limit);
    std::vector<listed_pool> pools;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (!answers[i].error.empty()) {
            note(printable(nodes[i].node) + ": " + printable(answers[i].error));
            continue;
        }
        for (auto& each : pools_in(nodes[i].node, parse_json(answers[i].json))) {
            pools.push_back(std::move(each));
        }
    }
    if (resolved(format) == output_format::table) {
        write_output(pools_table(pools));
    } else {
        printer{format, false}.print(pools_json(pools));
    }
    if (pools.empty()) {
        note("none of these nodes is a bridge to other pools");
    }
}

// "3/4 +12": 3 of 4 workers run, and 12 jobs wait. "3" without workers, "-" if nothing is known.
std::string load_text(const std::optional<cles::node_load>& load) {
    if (!load) {
        return "-";
    }
    std::string out = std::to_string(load->running);
    if (load->workers != 0) {
        out.append("/").append(std::to_string(load->workers));
    }
    if (load->queued != 0) {
        out.append(" +").append(std::to_string(load->queued));
    }
    return out;
}

// "localization (PULL BIND)" for each task, in the order of the document.
std::string tasks_text(const std::string& tasks) {
    std::string out;
    std::string_view last;
    const auto list = parse_json(tasks);
    const auto all = offered_tasks(&list);
    for (const auto& offered : all) {
        if (out.empty() || offered.task != last) {
            out.append(out.empty() ? "" : "), ").append(printable(offered.task)).append(" (");
        } else {
            out.append(" ");
        }
        out.append(printable(offered.verb));
        last = offered.task;
    }
    return out.empty() ? out : out + ")";
}

std::string ls_table(const std::vector<listed_node>& nodes, bool tasks) {
    table out{"NODE", "STATE", "LOAD", "LAST SEEN", "ENDPOINTS"};
    const bool has_routes = std::ranges::any_of(nodes, [](const listed_node& node) { return node.hops != 1; });
    const bool has_pool = std::ranges::any_of(nodes, [](const listed_node& node) { return !node.pool.empty(); });
    const std::size_t route_column = has_routes ? out.column("ROUTE") : 0;
    const std::size_t pool_column = has_pool ? out.column("POOL") : 0;
    const std::size_t tasks_column = tasks ? out.column("TASKS") : 0;
    for (const auto& node : nodes) {
        out.row();
        out.set(0, printable(node.node));
        out.set(1, printable(node.state));
        out.set(2, load_text(node.load), true);
        out.set(3, node.last_seen());
        out.set(4, node.endpoints.empty() ? "-" : printable(joined(node.endpoints, " ")));
        if (has_routes) {
            out.set(route_column, printable(node.route()));
        }
        if (has_pool) {
            out.set(pool_column, printable(node.pool));
        }
        if (tasks) {
            out.set(tasks_column, node.tasks.empty() ? "(" + printable(node.error) + ")" : tasks_text(node.tasks));
        }
    }
    return out.text();
}

void write_node(cles::json_writer& w, const listed_node& node, bool tasks) {
    w.begin_object();
    w.key("node");
    w.value(std::string_view{node.node});
    if (!node.pool.empty()) {
        w.key("pool");
        w.value(std::string_view{node.pool});
    }
    w.key("endpoints");
    w.begin_array();
    for (const auto& endpoint : node.endpoints) {
        w.value(std::string_view{endpoint});
    }
    w.end_array();
    w.key("epoch");
    w.value(std::string_view{node.epoch});
    w.key("age_ms");
    w.value(node.age_ms.value_or(0));
    w.key("state");
    w.value(std::string_view{node.state});
    if (node.load) {
        w.key("load");
        write_load(w, *node.load);
    }
    if (node.hops != 1) {
        w.key("hops");
        w.value(std::uint64_t{node.hops});
        w.key("via");
        w.value(std::string_view{node.via});
    }
    if (tasks && node.tasks.empty()) {
        w.key("failure");
        w.value(std::string_view{node.error});
    } else if (tasks) {
        w.key("tasks");
        w.raw(node.tasks);
    }
    w.end_object();
}

// As the reply to PULL self:cles/peers; with `tasks` each has its tasks as in PULL self:cles, or `failure`, the reason
// why they are not known.
std::string ls_json(const std::vector<listed_node>& nodes, bool tasks) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("peers");
    w.begin_array();
    for (const auto& node : nodes) {
        write_node(w, node, tasks);
    }
    w.end_array();
    w.end_object();
    return out;
}

asio::awaitable<void> show(client& requester, const ls_arguments& args) {
    const auto until = std::chrono::steady_clock::now() + args.wait;
    auto nodes = co_await find_nodes(requester, args.addresses, until, args.timeout);
    const bool found_any = !nodes.empty();
    if (args.pools) {
        co_await show_pools(requester, nodes, args.timeout.value_or(2s), args.format);
        co_return;
    }
    if (args.tasks || !args.offered.empty()) {
        co_await query_tasks(requester, nodes, args.timeout.value_or(2s));
    }
    if (!args.offered.empty()) {
        std::erase_if(nodes, [&](const listed_node& node) { return !node.offers(args.offered); });
    }
    if (resolved(args.format) == output_format::table) {
        write_output(ls_table(nodes, args.tasks));
    } else {
        printer{args.format, false}.print(ls_json(nodes, args.tasks));
    }
    if (!found_any) {
        const bool hears_others = co_await hears_other_pools(requester);
        note("no node has announced itself on " + joined(cles::interfaces_of(args.addresses.group())) +
             "; --multicast selects other interfaces" +
             (args.addresses.is_secured()
                  ? "; if the roster is an old one, a request with --at tls://HOST brings that of the node there"
                  : ""));
        if (hears_others) {
            note("nodes of other pools announce themselves there: --pool NAME selects a pool");
        }
    }
}

void check_offered(const std::string& text) {
    const auto colon = text.find(':');
    if (!text.empty() && (!is_name(text.substr(colon == std::string::npos ? 0 : colon + 1)) ||
                          (colon != std::string::npos && !cles::verb_from(text.substr(0, colon))))) {
        throw usage_error("--offers '" + text + "': write TASK, or VERB:TASK as in delegate:primes");
    }
}

} // namespace

void add_ls(CLI::App& app, context& shared) {
    auto args = std::make_shared<ls_arguments>();
    auto* command = app.add_subcommand("ls", "List the nodes on the network");
    command->add_flag("-l,--tasks", args->tasks, "Ask each node for its tasks");
    command->add_option("--offers", args->offered, "Only nodes that offer this task: TASK, or VERB:TASK")
        ->type_name("TASK");
    command->add_flag("--pools", args->pools, "The other pools that these nodes reach as bridges");
    add_duration(*command, "-w,--wait", args->wait, "How long to listen (default 350ms)");
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, "2s");
    add_output_option(*command, args->format);
    command->footer("LOAD is RUNNING/WORKERS, and +N if N jobs are queued.\n"
                    "With --at, only that node and the nodes that it knows are listed. ROUTE is how\n"
                    "it reaches those that it has no link to.\n\n"
                    "Examples:\n"
                    "  cles ls\n"
                    "  cles ls -l -m eth0\n"
                    "  cles ls --offers delegate:primes\n"
                    "  cles ls -w 3s -o json | jq -r '.peers[].node'\n"
                    "  cles ls --at tcp://10.0.0.7");
    command->callback([args, &shared] {
        check_offered(args->offered);
        if (args->pools && (args->tasks || !args->offered.empty())) {
            throw usage_error("--pools lists pools, which have no --tasks or --offers");
        }
        args->addresses.check_discovery();
        client requester{args->addresses, shared.verbosity};
        shared.exit_code = requester.run(show(requester, *args));
    });
}

} // namespace tool
