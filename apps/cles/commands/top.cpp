// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/top_rows.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/find_nodes.hpp"
#include "discovery/listed_pool.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/errors.hpp"
#include "output/json_node.hpp"
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
#include <map>
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
    bool pools = false;
    bool tasks = false;
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
        bridges_.clear();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            top_row row{.node = std::move(nodes[i])};
            if (i < answers.size()) {
                read_metrics(answers[i], row);
            }
            rows_.push_back(std::move(row));
        }
        if (args_.pools) {
            co_await add_pools(limit);
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
            const auto metrics = parse_json(answer.json);
            row.rate = rates_.update(row.node.node + " " + row.node.epoch, metrics, steady::now());
            row.tasks = task_times_in(metrics);
            for (auto& pool : pools_in(row.node.node, metrics)) {
                if (pool.state == "live" && !row.node.url().empty()) {
                    bridges_.try_emplace(std::move(pool.pool), row.node.url());
                }
            }
        } catch (const cles::error& e) {
            row.node.error = e.message();
        }
    }

    // The nodes of the other pools, each pool asked through the first bridge that reaches it.
    asio::awaitable<void> add_pools(std::chrono::milliseconds limit) {
        for (const auto& [pool, url] : bridges_) {
            std::vector<std::string> bridge{url};
            const auto answers = co_await ask_all(requester_, pool + ".all:cles/metrics", std::move(bridge), limit);
            add_pool(pool, answers.front());
        }
    }

    void add_pool(const std::string& pool, const node_answer& answer) {
        const auto add = [&](const std::string& node, std::string why) -> top_row& {
            rows_.push_back({.node = {.node = pool + "." + node, .state = why.empty() ? "live" : "unknown"}});
            rows_.back().node.error = std::move(why);
            return rows_.back();
        };
        if (!answer.error.empty()) {
            add("all", answer.error);
            return;
        }
        try {
            const auto outcome = parse_json(answer.json);
            if (const auto* const results = outcome.find("results")) {
                for (const auto& [node, metrics] : results->members) {
                    auto& row = add(node, {});
                    row.rate = rates_.update(row.node.node, metrics, steady::now());
                    row.tasks = task_times_in(metrics);
                }
            }
            if (const auto* const errors = outcome.find("errors")) {
                for (const auto& [node, failure] : errors->members) {
                    const auto* const code = failure.find("error");
                    add(node, code == nullptr ? "failed" : code->text);
                }
            }
        } catch (const cles::error& e) {
            add("all", e.message());
        }
    }

    void show() {
        if (screen_) {
            const auto title = bold(stream::out, "cles top") + "  " + summary_of(rows_) + "  (every " +
                               to_text(args_.interval) + "; q quits)";
            screen_->show(title + "\n" + printable(error_) + "\n" + tables());
            return;
        }
        if (!error_.empty()) {
            print_error(error_);
        }
        if (resolved(args_.format) == output_format::table) {
            write_output((is_first_ ? "" : "\n") + tables());
        } else {
            printer{args_.format, false}.print(to_json(rows_));
        }
        is_first_ = false;
    }

    [[nodiscard]] std::string tables() const {
        return to_table(rows_) + (args_.tasks ? "\n" + tasks_to_table(rows_) : std::string{});
    }

    client& requester_;
    const top_arguments& args_;
    std::optional<screen> screen_;
    node_rates rates_;
    std::vector<top_row> rows_;
    std::map<std::string, std::string> bridges_; // the URL of one that reaches the pool, by pool
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
    command->add_flag("--tasks", args->tasks, "Also how long the handlers of each task take, the slowest first");
    command->add_flag("--pools", args->pools, "Also the nodes of other pools that these nodes reach as bridges");
    args->addresses.add_options(*command);
    add_output_option(*command, args->format);
    command->footer("The nodes are asked for their metrics; rates are shown from the second refresh on.\n"
                    "With --at, only that node and the nodes that it knows are shown.\n\n"
                    "Examples:\n"
                    "  cles top\n"
                    "  cles top --at tcp://10.0.0.7 --sort name\n"
                    "  cles top --pools\n"
                    "  cles top --tasks\n"
                    "  cles top -n 2 -o json | jq -c '.nodes[] | [.node, .requests_per_s]'");
    command->callback([args, &shared] {
        args->addresses.check_discovery();
        client requester{args->addresses, shared.verbosity};
        shared.exit_code = requester.run(watch(requester, *args));
    });
}

} // namespace tool
