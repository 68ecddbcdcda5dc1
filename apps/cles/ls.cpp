// SPDX-License-Identifier: BSL-1.0
#include "client.hpp"
#include "commands.hpp"
#include "common_options.hpp"
#include "context.hpp"
#include "diagnostics.hpp"
#include "failure.hpp"
#include "listing.hpp"
#include "output.hpp"
#include "printer.hpp"

#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <CLI/App.hpp>

#include <chrono>
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
    output_format format = output_format::automatic;
};

/// Asks several nodes at once what they offer. Answers may still come when nobody waits for them any more.
class task_query : public std::enable_shared_from_this<task_query> {
  public:
    task_query(client& asker, std::vector<listed_node> nodes)
        : asker_(asker), nodes_(std::move(nodes)), ended_(asker.context()) {}

    asio::awaitable<void> run(std::chrono::milliseconds limit) {
        ended_.expires_at(asio::steady_timer::time_point::max());
        for (auto& node : nodes_) {
            if (node.endpoints.empty()) {
                node.error = "no address that can be used from here";
            } else {
                ask(node, limit);
            }
        }
        boost::system::error_code code;
        if (missing_ > 0) {
            co_await ended_.async_wait(asio::redirect_error(asio::use_awaitable, code));
        }
        if (missing_ > 0) {
            throw boost::system::system_error(code); // interrupted
        }
    }
    [[nodiscard]] const std::vector<listed_node>& nodes() const noexcept { return nodes_; }

  private:
    void ask(listed_node& node, std::chrono::milliseconds limit) {
        ++missing_;
        cles::call_options options;
        options.at(node.endpoints.front()).deadline(limit).diagnostics(node.error);
        const auto on_answer = [self = shared_from_this(), &node](boost::system::error_code code,
                                                                  const cles::json_text& answer) {
            if (!code) {
                node.error.clear();
                node.learn(answer.text);
            } else if (node.error.empty()) {
                node.error = code.message();
            }
            if (--self->missing_ == 0) {
                self->ended_.cancel();
            }
        };
        asker_.node().async_pull("self:cles", options, on_answer);
    }

    client& asker_;
    std::vector<listed_node> nodes_;
    asio::steady_timer ended_;
    std::size_t missing_ = 0;
};

asio::awaitable<std::vector<listed_node>> find_nodes(client& asker, const ls_command& wanted) {
    if (wanted.addresses.finds_by_name()) {
        co_await asker.sleep_until(std::chrono::steady_clock::now() + wanted.wait);
        co_return listed(asker.node().peers());
    }
    // Whom does that one know?
    const auto options = asker.options_for("self:cles", wanted.timeout);
    const cles::json_text itself = co_await asker.node().async_pull("self:cles", options);
    const cles::json_text others = co_await asker.node().async_pull("self:cles/peers", options);
    co_return listed(itself.text, others.text);
}

asio::awaitable<void> show(client& asker, const ls_command& wanted) {
    auto nodes = co_await find_nodes(asker, wanted);
    if (wanted.tasks) {
        const auto query = std::make_shared<task_query>(asker, std::move(nodes));
        co_await query->run(wanted.timeout.value_or(2s));
        nodes = query->nodes();
    }
    if (resolved(wanted.format) == output_format::table) {
        write_output(to_table(nodes, wanted.tasks));
    } else {
        printer{wanted.format, false}.print(to_json(nodes, wanted.tasks));
    }
    if (nodes.empty()) {
        note("nobody has announced itself on " + wanted.addresses.group().interface +
             "; --multicast says where else to listen");
    }
}

} // namespace

void add_ls(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<ls_command>();
    auto* command = app.add_subcommand("ls", "List the nodes that are there");
    command->add_flag("-l,--tasks", wanted->tasks, "Ask each node what it offers");
    add_duration(*command, "-w,--wait", wanted->wait, "How long to listen (default 350ms)");
    wanted->addresses.add_options(*command);
    add_timeout(*command, wanted->timeout, "2s");
    add_output_option(*command, wanted->format);
    command->footer("With --at it lists the nodes that the node there knows, and itself.\n\n"
                    "Examples:\n"
                    "  cles ls\n"
                    "  cles ls -l -m eth0\n"
                    "  cles ls -w 3s -o json | jq -r '.peers[].node'\n"
                    "  cles ls --at tcp://10.0.0.7");
    command->callback([wanted, &shared] {
        if (!wanted->addresses.finds_by_name() && !wanted->addresses.has_url()) {
            throw usage_error("without multicast nobody is heard: say where with --multicast IFACE, or ask a node "
                              "whom it knows with --at URL");
        }
        client asker{wanted->addresses, shared.verbosity};
        shared.exit_code = asker.run(show(asker, *wanted));
    });
}

} // namespace tool
