// SPDX-License-Identifier: BSL-1.0
#include <cles/json_writer.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_arguments.hpp"
#include "options/common_options.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {
namespace {

namespace asio = boost::asio;

struct bind_arguments {
    feed_arguments feed;
    output_format format = output_format::automatic;
};

using bound_item = feed_set::item;

// The last value, in the reply to BIND, has no number.
std::string with_source(const std::string& noun, const bound_item& item, bool is_of_many) {
    const auto source = source_of(noun, item);
    std::string text;
    cles::json_writer w{text};
    w.begin_object();
    w.plain_key("node");
    w.value(std::string_view{source.node});
    if (is_of_many) {
        w.plain_key("noun");
        w.value(std::string_view{source.path});
    }
    w.plain_key("seq");
    if (item.kind == cles::feed_event::update) {
        w.value(item.seq);
    } else {
        w.null();
    }
    w.plain_key("update");
    w.raw(item.value.text);
    w.end_object();
    return text;
}

// Of several nouns, each update is shown with its noun, and for `all:` with its publisher.
void show(printer& out, const bind_arguments& args, const std::string& noun, const bound_item& item) {
    const auto seq = item.kind == cles::feed_event::update ? std::to_string(item.seq) : "-";
    std::vector<json_cell> leading{{"seq", seq, true}};
    const bool is_of_many = args.feed.is_of_many();
    if (!is_of_many && !noun.starts_with("all:")) {
        out.print(item.value.text, std::move(leading));
    } else if (resolved(args.format) == output_format::table) {
        const auto source = source_of(noun, item);
        leading.insert(leading.begin(), is_of_many ? json_cell{"NOUN", printable(source.noun()), false}
                                                   : json_cell{"NODE", printable(source.node), false});
        out.print(item.value.text, std::move(leading));
    } else {
        out.print(with_source(noun, item, is_of_many));
    }
}

asio::awaitable<void> show_all(client& requester, const bind_arguments& args) {
    printer out{args.format, true};
    const auto show_one = [&](const std::string& noun, const bound_item& item) { show(out, args, noun, item); };
    co_await follow_values(requester, args.feed, show_one);
}

} // namespace

void add_bind(CLI::App& app, context& shared) {
    auto args = std::make_shared<bind_arguments>();
    auto* command = app.add_subcommand("bind", "Get updates as they are published");
    args->feed.add_options(*command, "Number of updates, including the last value; 0: until interrupted (default 0)")
        ->required();
    command->add_flag("--wait", args->feed.waits, "Wait for nodes and nouns that are not there yet");
    add_output_option(*command, args->format);
    refuse_body(*command, "BIND");
    command->footer(
        "In a pattern, * stands for any characters of a name or a parameter, and /** at the end for all\n"
        "that may follow. The nouns are those that nodes publish at the start; with --wait also those that\n"
        "come later. Of several nouns, each update is shown with its noun.\n"
        "Missed updates, and a publisher that is lost or returns, are reported on stderr.\n\n"
        "Examples:\n"
        "  cles bind car1:localization\n"
        "  cles bind car1:localization --every 1s -n 10\n"
        "  cles bind all:localization\n"
        "  cles bind car1:localization car2:notice 'car1:tyre/**'\n"
        "  cles bind 'all:loc*' --wait\n"
        "  cles bind car1:localization --multicast eth0\n"
        "  cles bind car1:localization -o json | jq -c '[.lat,.lon]'");
    command->callback([args, &shared] {
        args->feed.check();
        client requester{args->feed.addresses, shared.verbosity, args->feed.uses_multicast()};
        args->feed.prepare(requester);
        shared.exit_code = requester.run(show_all(requester, *args));
    });
}

} // namespace tool
