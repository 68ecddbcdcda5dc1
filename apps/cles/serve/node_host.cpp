// SPDX-License-Identifier: BSL-1.0
#include "serve/node_host.hpp"

#include "output/errors.hpp"
#include "output/terminal.hpp"

#include <chrono>
#include <csignal>
#include <string>
#include <string_view>
#include <utility>

namespace tool {

using namespace std::chrono_literals;

node_host::node_host(const node_arguments& args, int verbosity) : log_(verbosity), signals_(io_, SIGINT, SIGTERM) {
    auto options = args.options(log_.sink());
    if (!args.allows_clash()) {
        options.on_name_taken = [this, name = options.name](std::string_view where) {
            log(cles::log_level::error, "stopping: the node at " + std::string{where} + " had the name '" + name +
                                            "' first; choose another name (--name), or allow it (--allow-clash)");
            stop(exit_code::local_failure);
        };
    }
    node_.emplace(io_, options);
}

int node_host::run(std::function<void()> on_stop, const cles::run_options& how) {
    on_stop_ = std::move(on_stop);
    signals_.async_wait([this](boost::system::error_code failed, int signal) {
        if (!failed) {
            log(cles::log_level::info, signal == SIGINT ? "stopping on SIGINT" : "stopping on SIGTERM");
            stop(exit_code::success);
        }
    });
    for (const auto& endpoint : node_->endpoints()) {
        write_output(node_->name() + " listening on " + endpoint + "\n");
    }
    cles::run(io_, how);
    return code_.value_or(exit_code::success);
}

void node_host::stop(int code) {
    if (code_) {
        return;
    }
    code_ = code;
    signals_.cancel();
    if (on_stop_) {
        on_stop_();
    }
    node_->stop();
}

void node_host::finish(int code) {
    node_->async_close(1s, [this, code](boost::system::error_code) { stop(code); });
}

} // namespace tool
