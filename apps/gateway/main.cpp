// SPDX-License-Identifier: BSL-1.0
// The program that `cles gateway` starts, with the options that it was given: a node that serves the network to HTTP
// clients (docs/gateway.md).
#include <cles/convert.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "client/logging.hpp"
#include "gateway/access/admission.hpp"
#include "gateway/access/tokens.hpp"
#include "gateway/arguments.hpp"
#include "gateway/serve/handler.hpp"
#include "gateway/serve/http_server.hpp"
#include "gateway/serve/span_exporter.hpp"
#include "gateway/settings.hpp"
#include "options/arguments.hpp"
#include "output/end_of_output.hpp"
#include "output/errors.hpp"
#include "output/help_formatter.hpp"
#include "output/terminal.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <sys/resource.h>

namespace {

namespace asio = boost::asio;
using namespace gateway;

/// Reads the tokens again whenever their file changes. Without a file that can be used, none counts.
class token_watch {
  public:
    token_watch(asio::io_context& io, const std::string& path, admission& door, cles::log_sink log)
        : file_(path), door_(door), log_(std::move(log)), timer_(io) {}

    /// \throws std::runtime_error if the file cannot be used now
    void start() {
        read();
        wait();
    }
    void stop() { timer_.cancel(); }

  private:
    void read() {
        if (auto found = file_.read_if_changed()) {
            log_(cles::log_level::info, "tokens that are accepted: " + std::to_string(found->size()));
            door_.set_tokens(std::move(*found));
        }
    }
    void wait() {
        timer_.expires_after(std::chrono::seconds{1});
        timer_.async_wait([this](boost::system::error_code code) {
            if (code) {
                return;
            }
            try {
                read();
            } catch (const std::runtime_error& e) {
                door_.set_tokens({});
                log_(cles::log_level::error, std::string{"no token is accepted: "} + e.what());
            }
            wait();
        });
    }

    token_file file_;
    admission& door_;
    cles::log_sink log_;
    asio::steady_timer timer_;
};

/// Lets this process open as many files as it needs for all connections, so that these do not shut out the links of its
/// node. Returns what is wrong; empty if nothing is.
std::string provide_files(std::size_t connections) {
    constexpr rlim_t others = 1024; // links, listeners, libraries
    const rlim_t needed = connections + others;
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur >= needed) {
        return {};
    }
    files.rlim_cur = std::min(files.rlim_max, needed);
    if (::setrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur >= needed) {
        return {};
    }
    return "this process may open " + std::to_string(files.rlim_cur) + " files, which is too few for " +
           std::to_string(connections) + " connections: state fewer (--connections), or allow more (ulimit -n)";
}

void make_token(const tool::gateway_arguments& given) {
    if (!tool::is_name(given.new_token) || given.tokens.empty()) {
        throw tool::usage_error("--new-token needs the name of a member, and --tokens the file that gets the hash");
    }
    tool::write_output(token_file{given.tokens}.add(given.new_token) + "\n");
    tool::note("the token is nowhere else: give it to " + given.new_token);
}

void serve(const tool::gateway_arguments& given, int verbosity) {
    const auto http = http_settings_of(given);
    const auto collector = given.collector.empty() ? collector_address{} : collector_at(given.collector);
    const auto tls = http.origins.is_tls ? tls_context(given.certificate, given.certificate_key) : nullptr;
    const tool::server_log output{verbosity};
    const auto& log = output.sink();
    const auto warn = [&log](const std::string& text) { log(cles::log_level::warning, text); };

    if (const auto too_few = provide_files(given.connections); !too_few.empty()) {
        warn(too_few);
    }
    asio::io_context io{1};
    asio::signal_set signals{io, SIGINT, SIGTERM};
    admission door{http.needs_token, sha256_of};
    token_watch tokens{io, given.tokens, door, log};
    if (http.needs_token) {
        tokens.start();
    }
    gateway_counts counts;
    auto options = node_options_of(given, log);
    options.metrics = [&counts](cles::json_writer& w) {
        w.key("gateway");
        cles::write_json(w, counts);
    };
    options.on_name_taken = [warn](std::string_view where) {
        warn("the node at " + std::string{where} + " had this one's name first: choose another one (--name)");
    };
    cles::service node{io, options};
    const auto spans =
        given.collector.empty() ? nullptr : std::make_shared<span_exporter>(node, collector, counts, warn);
    const bool is_secured = !given.keys.given_directory().empty();
    handler answers{node, {.origins = http.origins, .is_secured = is_secured}, door, counts, spans, warn};
    const client_limits limits{given.connections, given.behind_proxy ? 0 : given.connections_per_address};
    http_server server{io, answers, counts, limits, tls.get(), warn};

    for (const auto& each : http.endpoints) {
        tool::write_output(node.name() + " listening on " + server.listen(each) + "\n");
    }
    if (spans) {
        spans->start();
    }
    signals.async_wait([&](boost::system::error_code code, int signal) {
        if (!code) {
            log(cles::log_level::info, signal == SIGINT ? "stopping on SIGINT" : "stopping on SIGTERM");
            server.stop();
            tokens.stop();
            if (spans) {
                spans->stop();
            }
            node.stop();
        }
    });
    cles::run(io);
}

} // namespace

int main(int argc, char** argv) {
    // A client that closes its connection is reported as an error of the write.
    std::signal(SIGPIPE, SIG_IGN);
    tool::check_output_at_exit("cles gateway", tool::exit_code::local_failure);
    tool::gateway_arguments given;
    int verbosity = 0;
    CLI::App command{"", "cles gateway"};
    command.formatter(std::make_shared<tool::help_formatter>());
    command.add_flag("-v,--verbose", verbosity, "Log more on stderr; twice: also every line sent and received");
    tool::add_gateway_arguments(command, given);
    try {
        command.parse(argc, argv);
        if (given.new_token.empty()) {
            serve(given, verbosity);
        } else {
            make_token(given);
        }
        return tool::exit_code::success;
    } catch (const CLI::Success& asked_for_help) {
        return command.exit(asked_for_help);
    } catch (const CLI::ParseError& wrong) {
        tool::print_error(wrong.what());
        tool::note("cles help gateway shows its options");
        return tool::exit_code::usage;
    } catch (...) {
        return tool::report_failure(std::current_exception());
    }
}
