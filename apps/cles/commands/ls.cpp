// SPDX-License-Identifier: BSL-1.0
#include <cles/verb.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "context.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/listed_node.hpp"
#include "discovery/node_search.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/diagnostics.hpp"
#include "output/failure.hpp"
#include "output/output.hpp"
#include "output/printer.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;

namespace {

struct ls_command {
    address_book addresses;
    std::chrono::milliseconds wait{350}; // a round of asking, and a little
    std::optional<std::chrono::milliseconds> timeout;
    bool tasks = false;
    std::string offered;
    output_format format = output_format::automatic;
};

// Asks each node what it offers.
asio::awaitable<void> learn_tasks(client& asker, std::vector<listed_node>& nodes, std::chrono::milliseconds limit) {
    std::vector<std::string> urls;
    urls.reserve(nodes.size());
    for (const auto& node : nodes) {
        urls.push_back(node.endpoints.empty() ? "" : node.endpoints.front());
    }
    const auto answers = co_await ask_all(asker, "self:cles", std::move(urls), limit);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        nodes[i].error = answers[i].error;
        if (nodes[i].error.empty()) {
            nodes[i].learn(answers[i].json);
        }
    }
}

asio::awaitable<void> show(client& asker, const ls_command& wanted) {
    const auto listen_until = std::chrono::steady_clock::now() + wanted.wait;
    auto nodes = co_await find_nodes(asker, wanted.addresses, listen_until, wanted.timeout);
    const bool is_anybody_there = !nodes.empty();
    if (wanted.tasks || !wanted.offered.empty()) {
        co_await learn_tasks(asker, nodes, wanted.timeout.value_or(2s));
    }
    if (!wanted.offered.empty()) {
        std::erase_if(nodes, [&](const listed_node& node) { return !node.offers(wanted.offered); });
    }
    if (resolved(wanted.format) == output_format::table) {
        write_output(to_table(nodes, wanted.tasks));
    } else {
        printer{wanted.format, false}.print(to_json(nodes, wanted.tasks));
    }
    if (!is_anybody_there) {
        note("nobody has announced itself on " + names_of(cles::interfaces_of(wanted.addresses.group())) +
             "; --multicast says where else to listen");
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
    auto wanted = std::make_shared<ls_command>();
    auto* command = app.add_subcommand("ls", "List the nodes on the network");
    command->add_flag("-l,--tasks", wanted->tasks, "Ask each node what it offers");
    command->add_option("--offers", wanted->offered, "Only nodes that offer this task: TASK, or VERB:TASK")
        ->type_name("TASK");
    add_duration(*command, "-w,--wait", wanted->wait, "How long to listen (default 350ms)");
    wanted->addresses.add_options(*command);
    add_timeout(*command, wanted->timeout, "2s");
    add_output_option(*command, wanted->format);
    command->footer("LOAD is running/workers, and +N where so many pieces of work wait.\n"
                    "With --at it lists the nodes that the node there knows, and itself.\n\n"
                    "Examples:\n"
                    "  cles ls\n"
                    "  cles ls -l -m eth0\n"
                    "  cles ls --offers delegate:primes\n"
                    "  cles ls -w 3s -o json | jq -r '.peers[].node'\n"
                    "  cles ls --at tcp://10.0.0.7");
    command->callback([wanted, &shared] {
        check_offered(wanted->offered);
        if (!wanted->addresses.finds_by_name() && !wanted->addresses.has_url()) {
            throw usage_error("without multicast nobody is heard: say where with --multicast IFACE, or ask a node "
                              "whom it knows with --at URL");
        }
        client asker{wanted->addresses, shared.verbosity};
        shared.exit_code = asker.run(show(asker, *wanted));
    });
}

} // namespace tool
