// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/top_rows.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/screen.hpp"
#include "output/terminal.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tool {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t max_queried = 256; // more would be a load of their own; of the others, announcements are shown

struct top_arguments {
    address_book addresses;
    std::chrono::milliseconds interval{1000};
    std::uint64_t count = 0;
    top_order order = top_order::load;
    output_format format = output_format::automatic;
};

class live_view {
  public:
    live_view(client& requester, const top_arguments& args) : requester_(requester), args_(args) {}

    asio::awaitable<void> run() {
        if (args_.format == output_format::automatic && screen::is_supported()) {
            screen_.emplace(requester_.context(), [this] { requester_.end(exit_code::success); });
        }
        auto next = steady::now();
        if (args_.addresses.finds_by_name()) {
            next += std::min(discovery_time, args_.interval);
        }
        for (std::uint64_t shown = 0; args_.count == 0 || shown < args_.count; ++shown) {
            co_await requester_.sleep_until(next);
            next = std::max(next + args_.interval, steady::now());
            co_await refresh(shown == 0);
            show();
        }
    }

  private:
    asio::awaitable<void> refresh(bool first) {
        const auto limit = std::clamp<std::chrono::milliseconds>(args_.interval / 2, 50ms, 1s);
        error_.clear();
        std::vector<listed_node> nodes;
        try {
            auto found = co_await find_nodes(requester_, args_.addresses, steady::now(), limit);
            nodes = std::move(found);
        } catch (const cles::error& e) {
            if (first || e.code() == cles::errc::cancelled) {
                throw;
            }
            error_ = e.what(); // it may answer again
        }
        auto urls = urls_of(nodes);
        urls.resize(std::min(urls.size(), max_queried));
        const auto answers = co_await ask_all(requester_, "self:cles/metrics", std::move(urls), limit);
        rows_.clear();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            top_row row{.node = std::move(nodes[i])};
            if (i < answers.size()) {
                read_metrics(answers[i], row);
            }
            rows_.push_back(std::move(row));
        }
        rates_.remove_before(steady::now() - std::max<std::chrono::milliseconds>(args_.interval * 10, 1min));
        sort_rows(rows_, args_.order);
    }

    void read_metrics(const node_answer& answer, top_row& row) {
        row.node.error = answer.error;
        if (!answer.error.empty()) {
            return;
        }
        try {
            row.rate = rates_.update(row.node.node + " " + row.node.epoch, answer.json, steady::now());
        } catch (const cles::error& e) {
            row.node.error = e.message();
        }
    }

    void show() {
        if (screen_) {
            const auto title = bold(stream::out, "cles top") + "  " + summary_of(rows_) + "  (every " +
                               to_text(args_.interval) + "; q quits)";
            screen_->show(title + "\n" + printable(error_) + "\n" + to_table(rows_));
            return;
        }
        if (!error_.empty()) {
            print_error(error_);
        }
        if (resolved(args_.format) == output_format::table) {
            write_output((is_first_ ? "" : "\n") + to_table(rows_));
        } else {
            printer{args_.format, false}.print(to_json(rows_));
        }
        is_first_ = false;
    }

    client& requester_;
    const top_arguments& args_;
    std::optional<screen> screen_;
    node_rates rates_;
    std::vector<top_row> rows_;
    std::string error_;
    bool is_first_ = true;
};

// The view ends with the coroutine, so that the screen is restored before a failure is reported.
asio::awaitable<void> watch(client& requester, const top_arguments& args) {
    live_view view{requester, args};
    co_await view.run();
}

} // namespace

void add_top(CLI::App& app, context& shared) {
    auto args = std::make_shared<top_arguments>();
    auto* command = app.add_subcommand("top", "Watch the load of the nodes");
    command
        ->add_option_function<std::string>(
            "-i,--interval",
            [args](const std::string& text) {
                args->interval = parse_duration(text);
                if (args->interval < 100ms) {
                    throw usage_error("--interval '" + text + "' is too short: at least 100ms");
                }
            },
            "Time between refreshes (default 1s)")
        ->type_name("TIME");
    add_count(*command, args->count, "Number of refreshes; 0: until interrupted (default 0)");
    command
        ->add_option_function<std::string>(
            "--sort",
            [args](const std::string& name) { args->order = name == "name" ? top_order::name : top_order::load; },
            "The order: load or name (default load)")
        ->type_name("WORD")
        ->check(CLI::IsMember({"load", "name"}).description(""));
    args->addresses.add_options(*command);
    add_output_option(*command, args->format);
    command->footer("The nodes are asked for their metrics; rates are shown from the second refresh on.\n"
                    "With --at, only that node and the nodes that it knows are shown.\n\n"
                    "Examples:\n"
                    "  cles top\n"
                    "  cles top --at tcp://10.0.0.7 --sort name\n"
                    "  cles top -n 2 -o json | jq -c '.nodes[] | [.node, .requests_per_s]'");
    command->callback([args, &shared] {
        args->addresses.check_discovery();
        client requester{args->addresses, shared.verbosity};
        shared.exit_code = requester.run(watch(requester, *args));
    });
}

} // namespace tool
