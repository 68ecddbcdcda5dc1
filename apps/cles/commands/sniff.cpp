// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/json_writer.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_arguments.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <string_view>

namespace tool {
namespace {

namespace asio = boost::asio;
using wall_clock = std::chrono::system_clock;

struct sniff_arguments {
    feed_arguments feed{};
    output_format format = output_format::automatic;
};

// "12:00:00.000", of this host's time zone.
std::string local_clock_text(wall_clock::time_point at) {
    const auto since = std::chrono::floor<std::chrono::milliseconds>(at.time_since_epoch()).count();
    const auto seconds = static_cast<std::time_t>(since / 1000);
    std::tm parts{};
    ::localtime_r(&seconds, &parts);
    std::array<char, 64> out{};
    std::snprintf(out.data(), out.size(), "%02d:%02d:%02d.%03d", parts.tm_hour, parts.tm_min, parts.tm_sec,
                  static_cast<int>(since % 1000));
    return out.data();
}

std::string sniffed_line(const std::string& noun, const feed_set::item& item) {
    const auto seq = item.kind == cles::feed_event::update ? "#" + std::to_string(item.seq) : std::string{"-"};
    return local_clock_text(wall_clock::now()) + "  " + bold(stream::out, printable(source_of(noun, item).noun())) +
           "  " + seq + "  " + printable(item.value.text) + "\n";
}

std::string sniffed_json(const std::string& noun, const feed_set::item& item) {
    std::string text;
    cles::json_writer w{text};
    w.begin_object();
    w.plain_key("at");
    cles::write_json(w, std::chrono::floor<std::chrono::milliseconds>(wall_clock::now()));
    w.plain_key("noun");
    w.value(std::string_view{source_of(noun, item).noun()});
    w.plain_key("seq");
    if (item.kind == cles::feed_event::update) {
        w.value(item.seq);
    } else {
        w.null();
    }
    w.plain_key("update");
    w.raw(item.value.text);
    w.end_object();
    return text + "\n";
}

asio::awaitable<void> sniff(client& requester, const sniff_arguments& args) {
    const bool is_text = resolved(args.format) == output_format::table;
    const auto show = [is_text](const std::string& noun, const feed_set::item& item) {
        write_output(is_text ? sniffed_line(noun, item) : sniffed_json(noun, item));
    };
    co_await follow_values(requester, args.feed, show);
}

} // namespace

void add_sniff(CLI::App& app, context& shared) {
    auto args = std::make_shared<sniff_arguments>();
    auto* command = app.add_subcommand("sniff", "Watch everything that nodes publish");
    args->feed.add_options(*command, "Number of updates, including last values; 0: until interrupted (default 0)");
    add_output_option(*command, args->format);
    command->footer(
        "Without a noun or a pattern, all nouns of all nodes are bound that the command may see, also those\n"
        "that are published for the first time later.\n\n"
        "Examples:\n"
        "  cles sniff\n"
        "  cles sniff 'car*:**' --every 1s\n"
        "  cles sniff --duration 10s -o json | jq -r .noun | sort | uniq -c");
    command->callback([args, &shared] {
        auto& feed = args->feed;
        if (feed.nouns.empty()) {
            feed.addresses.check_discovery();
            feed.nouns.emplace_back("all:**");
        }
        feed.waits = true;
        feed.check();
        client requester{feed.addresses, shared.verbosity, feed.uses_multicast()};
        feed.prepare(requester);
        shared.exit_code = requester.run(sniff(requester, *args));
    });
}

} // namespace tool
