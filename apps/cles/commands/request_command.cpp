// SPDX-License-Identifier: BSL-1.0
#include "commands/request_command.hpp"

#include "client/client.hpp"
#include "context.hpp"
#include "discovery/router_search.hpp"
#include "options/arguments.hpp"
#include "options/body.hpp"
#include "options/common_options.hpp"
#include "output/progress_line.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <exception>
#include <memory>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

struct request_loop {
    /// By the first node that routes, where one has to be found: the others refuse before anything is begun.
    static asio::awaitable<cles::json_text> ask(client& asker, const std::string& command, cles::call_options& options,
                                                std::vector<std::string>& routers) {
        std::exception_ptr first_failure; // of the one that most likely routes
        const auto candidates = std::exchange(routers, {});
        for (const auto& url : candidates) {
            options.at(url); // and from now on, where it answers
            try {
                cles::json_text answer = co_await asker.node().async_request(command, options);
                co_return answer;
            } catch (const cles::error& e) {
                if (!is_refused_by_route(e)) {
                    throw;
                }
                first_failure = first_failure ? first_failure : std::current_exception();
            }
        }
        if (first_failure) {
            std::rethrow_exception(first_failure);
        }
        cles::json_text answer = co_await asker.node().async_request(command, options);
        co_return answer;
    }

    /// The node does not route, or is not there: another one may.
    static bool is_refused_by_route(const cles::error& e) {
        return e.code() == cles::errc::no_target || e.code().category() != cles::error_category();
    }

    static asio::awaitable<void> run(client& asker, const request_command& wanted, std::string command) {
        printer out{wanted.format_, wanted.count_ != 1};
        progress_line progress{wanted.progress_};
        auto options = asker.options_for(wanted.noun_, wanted.timeout_);
        options.urgent(wanted.urgent_);
        if (wanted.verb_ == cles::verb::delegate && progress.is_wanted()) {
            options.on_progress(
                [&progress](double fraction, std::string_view details) { progress.show(fraction, details); });
        }
        std::vector<std::string> routers;
        if (needs_router(wanted.addresses_, wanted.noun_)) {
            auto found = co_await possible_routers(asker);
            routers = std::move(found);
        }
        auto next = std::chrono::steady_clock::now();
        for (std::uint64_t i = 0; wanted.count_ == 0 || i < wanted.count_; ++i) {
            if (i > 0 && wanted.interval_.count() > 0) {
                next += wanted.interval_;
                co_await asker.sleep_until(next);
            }
            const cles::json_text answer = co_await ask(asker, command, options, routers);
            progress.clear();
            out.print(answer.text);
        }
    }
};

void request_command::add_options(CLI::App& command) {
    add_noun(command, noun_);
    addresses_.add_options(command);
    add_timeout(command, timeout_, verb_ == cles::verb::delegate ? "30s" : "5s");
    add_count(command, count_, "How often; 0: until interrupted (default 1)");
    add_duration(command, "-i,--interval", interval_, "From one request to the next; 0: no pause (default 1s)");
    add_output_option(command, format_);
}

void request_command::add_body_option(CLI::App& command) {
    command.add_option("-d,--data", body_, "The body: JSON, @FILE, or - for stdin")->type_name("JSON");
}

void request_command::add_urgent_option(CLI::App& command) {
    command.add_flag("--urgent", urgent_, "Let the answer pass others that wait at the node");
}

void request_command::add_progress_option(CLI::App& command) {
    command.add_flag("--progress", progress_, "Show progress, a line per report, though stderr is no terminal");
}

int request_command::run() {
    check_noun(noun_);
    std::string command{to_string(verb_)};
    command.append(" ").append(noun_);
    if (body_) {
        command.append(" ").append(read_body(*body_));
    }
    client asker{addresses_, shared_.verbosity};
    asker.explain_failures_of(noun_);
    return asker.run(request_loop::run(asker, *this, std::move(command)));
}

} // namespace tool
