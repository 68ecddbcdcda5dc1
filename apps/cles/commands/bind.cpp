// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_arguments.hpp"
#include "options/addresses.hpp"
#include "options/common_options.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace tool {
namespace {

namespace asio = boost::asio;

struct bind_arguments {
    feed_arguments feed;
    output_format format = output_format::automatic;
};

// The last value, in the reply to BIND, has no number.
std::string with_publisher(const cles::feed_item<cles::json_text>& item) {
    std::string text;
    cles::json_writer w{text};
    w.begin_object();
    w.plain_key("node");
    w.value(std::string_view{item.publisher});
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

// For `all:` each update is shown with its publisher.
void show(printer& out, const bind_arguments& args, const cles::feed_item<cles::json_text>& item) {
    const auto seq = item.kind == cles::feed_event::update ? std::to_string(item.seq) : "-";
    std::vector<json_cell> leading{{"seq", seq, true}};
    if (!args.feed.noun.starts_with("all:")) {
        out.print(item.value.text, std::move(leading));
    } else if (resolved(args.format) == output_format::table) {
        leading.insert(leading.begin(), {"NODE", printable(item.publisher), false});
        out.print(item.value.text, std::move(leading));
    } else {
        out.print(with_publisher(item));
    }
}

asio::awaitable<void> follow(client& requester, const bind_arguments& args) {
    printer out{args.format, true};
    const auto options = args.feed.options(requester);
    auto feed = co_await requester.node().async_bind(args.feed.noun, options);
    for (std::uint64_t shown = 0; args.feed.count == 0 || shown < args.feed.count;) {
        const auto item = co_await feed.async_next();
        if (item.has_value()) {
            show(out, args, item);
            ++shown;
        } else {
            note_event(args.feed.noun, item);
        }
    }
}

} // namespace

void add_bind(CLI::App& app, context& shared) {
    auto args = std::make_shared<bind_arguments>();
    auto* command = app.add_subcommand("bind", "Get updates as they are published");
    args->feed.add_options(*command, "Number of updates, including the last value; 0: until interrupted (default 0)");
    add_output_option(*command, args->format);
    refuse_body(*command, "BIND");
    command->footer("Missed updates, and a publisher that is lost or returns, are reported on stderr.\n\n"
                    "Examples:\n"
                    "  cles bind car1:localization\n"
                    "  cles bind car1:localization --every 1s -n 10\n"
                    "  cles bind all:localization\n"
                    "  cles bind car1:localization --multicast eth0\n"
                    "  cles bind car1:localization -o json | jq -c '[.lat,.lon]'");
    command->callback([args, &shared] {
        args->feed.check();
        client requester{args->feed.addresses, shared.verbosity, args->feed.is_multicast()};
        args->feed.prepare(requester);
        shared.exit_code = requester.run(follow(requester, *args));
    });
}

} // namespace tool
