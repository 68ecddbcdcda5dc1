// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "context.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/failure.hpp"
#include "output/output.hpp"
#include "output/printer.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <boost/describe.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

struct task_line {
    std::string verb;
    std::string task;
    std::optional<std::string> description;
    std::optional<std::vector<std::string>> parameters;
};
BOOST_DESCRIBE_STRUCT(task_line, (), (verb, task, description, parameters))

struct node_description {
    std::string node;
    std::optional<std::string> version;
    std::optional<int> protocol;
    std::optional<std::string> epoch;
    std::optional<std::int64_t> uptime_ms;
    std::optional<std::vector<std::string>> endpoints;
    std::vector<task_line> tasks;
};
BOOST_DESCRIBE_STRUCT(node_description, (), (node, version, protocol, epoch, uptime_ms, endpoints, tasks))

struct info_command {
    address_book addresses;
    std::string node = "self";
    std::string noun{};
    std::optional<std::chrono::milliseconds> timeout;
    output_format format = output_format::automatic;
};

std::string facts_of(const node_description& about) {
    std::string out;
    const auto add = [&](std::string_view name, const std::string& value) {
        out.append(bold(stream::out, name)).append(11 - name.size(), ' ').append(printable(value)).append("\n");
    };
    add("node", about.node);
    if (about.version) {
        add("version", *about.version);
    }
    if (about.protocol) {
        add("protocol", std::to_string(*about.protocol));
    }
    if (about.epoch) {
        add("epoch", *about.epoch);
    }
    if (about.uptime_ms) {
        add("uptime", to_text(std::chrono::milliseconds{*about.uptime_ms}));
    }
    std::string_view name = "endpoints";
    if (about.endpoints) {
        for (const auto& endpoint : *about.endpoints) {
            add(std::exchange(name, ""), endpoint);
        }
    }
    return out;
}

std::string tasks_of(const node_description& about) {
    table out;
    for (const char* title : {"VERB", "TASK", "DESCRIPTION"}) {
        out.column(title);
    }
    for (const auto& task : about.tasks) {
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

asio::awaitable<void> show(client& asker, const info_command& wanted) {
    const auto options = asker.options_for(wanted.noun, wanted.timeout);
    const cles::json_text answer = co_await asker.node().async_pull(wanted.noun, options);
    if (resolved(wanted.format) == output_format::table) {
        const auto about = cles::from_json<node_description>(answer.text);
        write_output(facts_of(about) + (about.tasks.empty() ? "" : "\n" + tasks_of(about)));
    } else {
        printer{wanted.format, false}.print(answer.text);
    }
}

} // namespace

void add_info(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<info_command>();
    auto* command = app.add_subcommand("info", "Show what a node is and what it offers");
    command->add_option("node", wanted->node, "A node's name or a URL (default: the node at --at)")->type_name("");
    wanted->addresses.add_options(*command);
    add_timeout(*command, wanted->timeout, "5s");
    add_output_option(*command, wanted->format);
    command->footer("Examples:\n"
                    "  cles info\n"
                    "  cles info tcp://10.0.0.7\n"
                    "  cles info --at unix:///run/car1.sock -o json | jq -r '.tasks[].task'");
    command->callback([wanted, &shared] {
        if (wanted->node.find("://") != std::string::npos) {
            wanted->addresses.set_at(std::exchange(wanted->node, "self"));
        }
        if (!is_name(wanted->node)) {
            throw usage_error("'" + wanted->node + "' is neither a node's name nor a URL such as tcp://10.0.0.7:25370");
        }
        wanted->noun = wanted->node + ":cles";
        client asker{wanted->addresses, shared.verbosity};
        shared.exit_code = asker.run(show(asker, *wanted));
    });
}

} // namespace tool
