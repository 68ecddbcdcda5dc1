// SPDX-License-Identifier: BSL-1.0
#include <cles/json_reader.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/task_types.hpp"
#include "discovery/stated_endpoints.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <boost/describe.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct task_document {
    std::string verb;
    std::string task;
    std::optional<std::string> description;
    std::optional<std::vector<std::string>> parameters;
};
BOOST_DESCRIBE_STRUCT(task_document, (), (verb, task, description, parameters))

struct node_document {
    std::string node;
    std::optional<std::string> pool;
    std::optional<std::string> version;
    std::optional<int> protocol;
    std::optional<std::string> epoch;
    std::optional<std::int64_t> uptime_ms;
    std::optional<std::vector<std::string>> endpoints;
    std::vector<task_document> tasks;
};
BOOST_DESCRIBE_STRUCT(node_document, (), (node, pool, version, protocol, epoch, uptime_ms, endpoints, tasks))

struct info_arguments {
    address_book addresses;
    std::string node = "self";
    std::string noun{};
    std::optional<std::chrono::milliseconds> timeout;
    output_format format = output_format::automatic;
};

std::string details_of(const node_document& node) {
    std::string out;
    const auto add = [&](std::string_view name, const std::string& value) {
        out.append(bold(stream::out, name)).append(11 - name.size(), ' ').append(printable(value)).append("\n");
    };
    add("node", node.node);
    if (node.pool) {
        add("pool", *node.pool);
    }
    if (node.version) {
        add("version", *node.version);
    }
    if (node.protocol) {
        add("protocol", std::to_string(*node.protocol));
    }
    if (node.epoch) {
        add("epoch", *node.epoch);
    }
    if (node.uptime_ms) {
        add("uptime", to_text(std::chrono::milliseconds{*node.uptime_ms}));
    }
    std::string_view name = "endpoints";
    if (node.endpoints) {
        for (const auto& endpoint : *node.endpoints) {
            add(std::exchange(name, ""), endpoint);
        }
    }
    return out;
}

std::string tasks_of(const node_document& node) {
    table out{"VERB", "TASK", "DESCRIPTION"};
    for (const auto& task : node.tasks) {
        std::string path = task.task;
        if (task.parameters) {
            for (const auto& parameter : *task.parameters) {
                path.append("/<").append(parameter).append(">");
            }
        }
        out.row();
        out.set(0, printable(task.verb));
        out.set(1, printable(path));
        out.set(2, printable(task.description.value_or("")));
    }
    return out.text();
}

// The answer with its endpoints as they are of use here; unchanged if it has none.
std::string as_seen_from_here(const std::string& answer, const std::string& asked) {
    cles::json_reader reader{answer};
    std::string_view key;
    std::string_view stated;
    if (reader.begin_object()) {
        while (reader.next_key(key)) {
            if (key == "endpoints") {
                reader.read_raw(stated);
                break;
            }
            if (!reader.skip()) {
                break;
            }
        }
    }
    auto out = answer;
    if (std::vector<std::string> endpoints; !stated.empty() && cles::from_json(stated, endpoints)) {
        out.replace(static_cast<std::size_t>(stated.data() - answer.data()), stated.size(),
                    cles::to_json(endpoints_from_here(asked, std::move(endpoints))));
    }
    return out;
}

asio::awaitable<void> show(client& requester, const info_arguments& args) {
    const auto options = requester.options_for(args.noun, args.timeout);
    const cles::json_text answer = co_await requester.node().async_pull(args.noun, options);
    const auto target = target_of(args.noun);
    const bool is_direct = target == "self" || !args.addresses.has_url(); // else another node has asked it
    const auto seen = args.format == output_format::raw || !is_direct
                          ? answer.text
                          : as_seen_from_here(answer.text, requester.endpoint_of(target));
    if (resolved(args.format) == output_format::table) {
        const auto node = cles::from_json<node_document>(seen);
        write_output(details_of(node) + (node.tasks.empty() ? "" : "\n" + tasks_of(node)));
    } else {
        printer{args.format, false}.print(seen);
    }
}

} // namespace

void add_info(CLI::App& app, context& shared) {
    auto args = std::make_shared<info_arguments>();
    auto* command = app.add_subcommand("info", "Describe a node and what it offers, or the types of a task");
    command
        ->add_option("node", args->node, "The name of a node, a URL, or the noun of a task (default: the node at --at)")
        ->type_name("");
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, "5s");
    add_output_option(*command, args->format);
    command->footer("Examples:\n"
                    "  cles info\n"
                    "  cles info tcp://10.0.0.7\n"
                    "  cles info car1:localization   # members, types, units\n"
                    "  cles info --at unix:///run/car1.sock -o json | jq -r '.tasks[].task'");
    command->callback([args, &shared] {
        const bool is_task = args->node.find("://") == std::string::npos && args->node.find(':') != std::string::npos;
        if (is_task) {
            check_noun(args->node);
        }
        args->noun = is_task ? args->node : args->addresses.use_target(args->node);
        client requester{args->addresses, shared.verbosity};
        shared.exit_code =
            requester.run(is_task ? show_task(requester, args->addresses, args->noun, args->timeout, args->format)
                                  : show(requester, *args));
    });
}

} // namespace tool
