// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "commands/top_rows.hpp"
#include "context.hpp"
#include "discovery/ask_all.hpp"
#include "discovery/node_search.hpp"
#include "options/common_options.hpp"
#include "options/duration.hpp"
#include "output/diagnostics.hpp"
#include "output/exit_code.hpp"
#include "output/failure.hpp"
#include "output/output.hpp"
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

constexpr auto first_round = 350ms;     // of asking who is there, and a little
constexpr std::size_t most_asked = 256; // more would be a load of its own; the others show what they announce

struct top_command {
    address_book addresses;
    std::chrono::milliseconds interval{1000};
    std::uint64_t count = 0;
    top_order order = top_order::load;
    output_format format = output_format::automatic;
};

class live_view {
  public:
    live_view(client& asker, const top_command& wanted) : asker_(asker), wanted_(wanted) {}

    asio::awaitable<void> run() {
        if (wanted_.format == output_format::automatic && screen::is_there()) {
            screen_.emplace(asker_.context(), [this] { asker_.end(exit_code::success); });
        }
        auto next = steady::now();
        if (wanted_.addresses.finds_by_name()) {
            next += std::min<std::chrono::milliseconds>(first_round, wanted_.interval);
        }
        for (std::uint64_t shown = 0; wanted_.count == 0 || shown < wanted_.count; ++shown) {
            co_await asker_.sleep_until(next);
            next = std::max(next + wanted_.interval, steady::now());
            co_await learn(shown == 0);
            show();
        }
    }

  private:
    asio::awaitable<void> learn(bool first) {
        const auto limit = std::clamp<std::chrono::milliseconds>(wanted_.interval / 2, 50ms, 1s);
        trouble_.clear();
        std::vector<listed_node> nodes;
        try {
            auto found = co_await find_nodes(asker_, wanted_.addresses, steady::now(), limit);
            nodes = std::move(found);
        } catch (const cles::error& e) {
            if (first || e.code() == cles::errc::cancelled) {
                throw;
            }
            trouble_ = e.what(); // it may come back
        }
        std::vector<std::string> urls;
        for (std::size_t i = 0; i < std::min(nodes.size(), most_asked); ++i) {
            urls.push_back(nodes[i].endpoints.empty() ? "" : nodes[i].endpoints.front());
        }
        const auto answers = co_await ask_all(asker_, "self:cles/metrics", std::move(urls), limit);
        rows_.clear();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            top_row row{.node = std::move(nodes[i])};
            if (i < answers.size()) {
                take(answers[i], row);
            }
            rows_.push_back(std::move(row));
        }
        rates_.forget_before(steady::now() - std::max<std::chrono::milliseconds>(wanted_.interval * 10, 1min));
        sort_rows(rows_, wanted_.order);
    }

    void take(const node_answer& answer, top_row& row) {
        row.node.error = answer.error;
        if (!answer.error.empty()) {
            return;
        }
        try {
            row.rate = rates_.take(row.node.node + " " + row.node.epoch, answer.json, steady::now());
        } catch (const cles::error& e) {
            row.node.error = e.message();
        }
    }

    void show() {
        if (screen_) {
            const auto about = bold(stream::out, "cles top") + "  " + summary_of(rows_) + "  (every " +
                               to_text(wanted_.interval) + "; q ends)";
            screen_->show(about + "\n" + printable(trouble_) + "\n" + to_table(rows_));
            return;
        }
        if (!trouble_.empty()) {
            complain(trouble_);
        }
        if (resolved(wanted_.format) == output_format::table) {
            write_output((is_first_ ? "" : "\n") + to_table(rows_));
        } else {
            printer{wanted_.format, false}.print(to_json(rows_));
        }
        is_first_ = false;
    }

    client& asker_;
    const top_command& wanted_;
    std::optional<screen> screen_;
    node_rates rates_;
    std::vector<top_row> rows_;
    std::string trouble_;
    bool is_first_ = true;
};

// The view lives no longer than the coroutine, so that the screen is as before when a failure is told.
asio::awaitable<void> watch(client& asker, const top_command& wanted) {
    live_view view{asker, wanted};
    co_await view.run();
}

} // namespace

void add_top(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<top_command>();
    auto* command = app.add_subcommand("top", "Watch the load of the nodes");
    command
        ->add_option_function<std::string>(
            "-i,--interval",
            [wanted](const std::string& text) {
                wanted->interval = parse_duration(text);
                if (wanted->interval < 100ms) {
                    throw usage_error("--interval '" + text + "' is too short: 100ms at least");
                }
            },
            "From one look to the next (default 1s)")
        ->type_name("TIME");
    add_count(*command, wanted->count, "How often; 0: until interrupted (default 0)");
    command
        ->add_option_function<std::string>(
            "--sort",
            [wanted](const std::string& name) { wanted->order = name == "name" ? top_order::name : top_order::load; },
            "By load or name (default load)")
        ->type_name("WORD")
        ->check(CLI::IsMember({"load", "name"}).description(""));
    wanted->addresses.add_options(*command);
    add_output_option(*command, wanted->format);
    command->footer(
        "A node is asked for what it counts; a rate shows from the second look on. With --at it watches the\n"
        "node there and those that it knows.\n\n"
        "Examples:\n"
        "  cles top\n"
        "  cles top --at tcp://10.0.0.7 --sort name\n"
        "  cles top -n 2 -o json | jq -c '.nodes[] | [.node, .requests_per_s]'");
    command->callback([wanted, &shared] {
        if (!wanted->addresses.finds_by_name() && !wanted->addresses.has_url()) {
            throw usage_error("without multicast nobody is heard: say where with --multicast IFACE, or ask a node "
                              "whom it knows with --at URL");
        }
        client asker{wanted->addresses, shared.verbosity};
        shared.exit_code = asker.run(watch(asker, *wanted));
    });
}

} // namespace tool
