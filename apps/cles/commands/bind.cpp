// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_command.hpp"
#include "commands/feed_events.hpp"
#include "context.hpp"
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

struct bind_command {
    feed_command feed;
    output_format format = output_format::automatic;
};

// Of `all:` it is told whose update it is.
void show(printer& out, const bind_command& wanted, const cles::feed_item<cles::json_text>& item) {
    const auto seq = item.kind == cles::feed_event::update ? std::to_string(item.seq) : "-";
    std::vector<json_cell> leading{{"seq", seq, true}};
    if (!wanted.feed.noun.starts_with("all:")) {
        out.print(item.value.text, std::move(leading));
    } else if (resolved(wanted.format) == output_format::table) {
        leading.insert(leading.begin(), {"NODE", printable(item.publisher), false});
        out.print(item.value.text, std::move(leading));
    } else {
        out.print(R"({"node":")" + item.publisher + R"(","seq":)" + seq + R"(,"update":)" + item.value.text + "}");
    }
}

asio::awaitable<void> follow(client& asker, const bind_command& wanted) {
    printer out{wanted.format, true};
    const auto options = wanted.feed.options(asker);
    auto feed = co_await asker.node().async_bind(wanted.feed.noun, options);
    for (std::uint64_t shown = 0; wanted.feed.count == 0 || shown < wanted.feed.count;) {
        const auto item = co_await feed.async_next();
        if (item.has_value()) {
            show(out, wanted, item);
            ++shown;
        } else {
            note_event(wanted.feed.noun, item);
        }
    }
}

} // namespace

void add_bind(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<bind_command>();
    auto* command = app.add_subcommand("bind", "Get updates as they are published");
    wanted->feed.add_options(*command, "How many updates, the publisher's last value included; 0: until interrupted "
                                       "(default 0)");
    add_output_option(*command, wanted->format);
    refuse_body(*command, "BIND");
    command->footer("Updates that were missed, and a publisher lost and found again, are told on stderr.\n\n"
                    "Examples:\n"
                    "  cles bind car1:localization\n"
                    "  cles bind car1:localization --every 1s -n 10\n"
                    "  cles bind all:localization\n"
                    "  cles bind car1:localization --multicast eth0\n"
                    "  cles bind car1:localization -o json | jq -c '[.lat,.lon]'");
    command->callback([wanted, &shared] {
        wanted->feed.check();
        client asker{wanted->feed.addresses, shared.verbosity, wanted->feed.is_multicast()};
        asker.explain_failures_of(wanted->feed.noun);
        wanted->feed.arm(asker);
        shared.exit_code = asker.run(follow(asker, *wanted));
    });
}

} // namespace tool
