// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/statistics.hpp"
#include "output/terminal.hpp"

#include <boost/describe.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace tool {

namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

struct self_description {
    std::string node;
    std::optional<std::string> version;
};
BOOST_DESCRIBE_STRUCT(self_description, (), (node, version))

struct ping_reply {
    std::string node;
    std::uint64_t seq = 0;
    double ms = 0;
};
BOOST_DESCRIBE_STRUCT(ping_reply, (), (node, seq, ms))

struct ping_summary {
    std::string node;
    std::uint64_t sent = 0;
    std::uint64_t received = 0;
};
BOOST_DESCRIBE_STRUCT(ping_summary, (), (node, sent, received))

/// Known after the first answer.
struct ping_times : ping_summary {
    double min_ms = 0;
    double avg_ms = 0;
    double max_ms = 0;
    double mdev_ms = 0;
};
BOOST_DESCRIBE_STRUCT(ping_times, (ping_summary), (min_ms, avg_ms, max_ms, mdev_ms))

struct ping_arguments {
    address_book addresses;
    std::string target = "self";
    std::optional<std::chrono::milliseconds> timeout;
    std::chrono::milliseconds interval{1000};
    std::uint64_t count = 4;
    bool json = false;
    std::string noun;
};

class pinger {
  public:
    pinger(client& requester, const ping_arguments& args) : requester_(requester), args_(args) {}
    pinger(const pinger&) = delete;
    pinger& operator=(const pinger&) = delete;

    asio::awaitable<void> run() {
        options_ = requester_.options_for(args_.noun, args_.timeout);
        // The first request, which is not timed, opens the connection and gets the name.
        const auto first = co_await requester_.node().async_pull<self_description>(args_.noun, options_);
        node_ = printable(first.node);
        if (!args_.json) {
            write_output("PING " + node_ + " (" + requester_.endpoint_of(target_of(args_.noun)) + "): PULL " +
                         args_.noun + (first.version ? ", version " + printable(*first.version) : "") + "\n");
        }
        std::exception_ptr ended;
        try {
            co_await repeat();
        } catch (...) {
            ended = std::current_exception();
        }
        summarize();
        if (ended) {
            std::rethrow_exception(ended);
        }
        if (received_ == 0) {
            std::rethrow_exception(last_failure_);
        }
    }

  private:
    asio::awaitable<void> repeat() {
        auto next = steady::now();
        while (args_.count == 0 || sent_ < args_.count) {
            if (sent_ > 0) {
                next += args_.interval;
                co_await requester_.sleep_until(next);
            }
            ++sent_;
            const auto start = steady::now();
            bool answered = false;
            try {
                co_await requester_.node().async_pull<self_description>(args_.noun, options_);
                answered = true;
            } catch (const cles::error& e) {
                if (e.code() == cles::errc::cancelled) {
                    throw;
                }
                last_failure_ = std::current_exception();
                print_error("seq=" + std::to_string(sent_) + " " + e.what());
            }
            if (answered) {
                report(std::chrono::duration<double, std::milli>{steady::now() - start}.count());
            }
        }
    }

    void report(double ms) {
        ++received_;
        times_.add(ms);
        if (args_.json) {
            write_output(cles::to_json(ping_reply{node_, sent_, rounded(ms, 4)}) + "\n");
        } else {
            write_output("answer from " + node_ + ": seq=" + std::to_string(sent_) + " time=" + fixed(ms, 3) + " ms\n");
        }
    }

    void summarize() {
        if (args_.json) {
            write_output(summary_as_json() + "\n");
            return;
        }
        const double lost =
            sent_ == 0 ? 0 : 100.0 * static_cast<double>(sent_ - received_) / static_cast<double>(sent_);
        std::string text = "\n--- " + node_ + " ping statistics ---\n" + std::to_string(sent_) + " requests, " +
                           std::to_string(received_) + " answers, " + fixed(lost, lost > 0 && lost < 100 ? 1 : 0) +
                           "% lost\n";
        if (!times_.empty()) {
            text += "round trip min/avg/max/mdev = " + fixed(times_.min(), 3) + "/" + fixed(times_.mean(), 3) + "/" +
                    fixed(times_.max(), 3) + "/" + fixed(times_.standard_deviation(), 3) + " ms\n";
        }
        write_output(text);
    }

    [[nodiscard]] std::string summary_as_json() const {
        const ping_summary all{node_, sent_, received_};
        if (times_.empty()) {
            return cles::to_json(all);
        }
        ping_times timed{all};
        timed.min_ms = rounded(times_.min(), 4);
        timed.avg_ms = rounded(times_.mean(), 4);
        timed.max_ms = rounded(times_.max(), 4);
        timed.mdev_ms = rounded(times_.standard_deviation(), 4);
        return cles::to_json(timed);
    }

    client& requester_;
    const ping_arguments& args_;
    cles::call_options options_;
    std::string node_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    statistics times_{100'000};
    std::exception_ptr last_failure_;
};

} // namespace

void add_ping(CLI::App& app, context& shared) {
    auto args = std::make_shared<ping_arguments>();
    auto* command = app.add_subcommand("ping", "Measure the round trip time of a small PULL");
    command->add_option("target", args->target, "A URL, or the name of a node (default: the node at --at)")
        ->type_name("");
    args->addresses.add_options(*command);
    add_timeout(*command, args->timeout, "5s");
    add_count(*command, args->count, "Number of requests; 0: until interrupted (default 4)");
    add_duration(*command, "-i,--interval", args->interval, "Time between requests (default 1s)");
    add_json_option(*command, args->json, "a document per reply, and one for the summary");
    command->footer("The first request, which opens the connection, is not timed.\n\n"
                    "Examples:\n"
                    "  cles ping tcp://10.0.0.7\n"
                    "  cles ping car1 --peer car1=unix:///run/car1.sock -n 1000 -i 0");
    command->callback([args, &shared] {
        args->noun = args->addresses.use_target(args->target);
        client requester{args->addresses, shared.verbosity};
        pinger work{requester, *args};
        shared.exit_code = requester.run(work.run());
    });
}

} // namespace tool
