// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_arguments.hpp"
#include "output/printer.hpp"
#include "output/statistics.hpp"
#include "output/terminal.hpp"

#include <boost/describe.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

namespace tool {

namespace asio = boost::asio;
using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

struct hz_arguments {
    feed_arguments feed;
    std::size_t window = 1000;
    bool json = false;
};

struct update_counts {
    std::uint64_t updates = 0;
    std::uint64_t missed = 0;
};
BOOST_DESCRIBE_STRUCT(update_counts, (), (updates, missed))

/// Known after the second update.
struct update_rate : update_counts {
    double rate = 0;
    double mean_ms = 0;
    double min_ms = 0;
    double max_ms = 0;
    double stddev_ms = 0;
};
BOOST_DESCRIBE_STRUCT(update_rate, (update_counts), (rate, mean_ms, min_ms, max_ms, stddev_ms))

/// The intervals between the updates of one noun.
class rate_meter {
  public:
    explicit rate_meter(std::size_t window) : intervals_(window) {}

    /// An event of its feed, other than an update that is counted.
    void take(const feed_set::item& item) {
        missed_ += item.missed;
        if (item.kind == cles::feed_event::lost) {
            last_.reset(); // the time until the next one is not an interval of the publisher
        }
    }

    void count(steady::time_point now) {
        if (last_) {
            intervals_.add(std::chrono::duration<double, std::milli>{now - *last_}.count());
        }
        last_ = now;
        ++updates_;
    }

    /// A line about the time until now.
    [[nodiscard]] std::string text() {
        const bool silent = updates_ == reported_;
        reported_ = updates_;
        const auto counted = std::to_string(updates_) + (updates_ == 1 ? " update" : " updates") + ", missed " +
                             std::to_string(missed_) + "\n";
        if (silent || intervals_.empty()) {
            return (silent ? "no update since the last line; " : "") + counted;
        }
        return fixed(1000 / intervals_.mean(), 2) + " updates/s; interval mean " + fixed(intervals_.mean(), 3) +
               " min " + fixed(intervals_.min(), 3) + " max " + fixed(intervals_.max(), 3) + " stddev " +
               fixed(intervals_.standard_deviation(), 3) + " ms over " + std::to_string(intervals_.count()) + "; " +
               counted;
    }

    [[nodiscard]] std::string json() const {
        const update_counts counts{updates_, missed_};
        if (intervals_.empty()) {
            return cles::to_json(counts);
        }
        update_rate now{counts};
        now.rate = rounded(1000 / intervals_.mean(), 3);
        now.mean_ms = rounded(intervals_.mean(), 4);
        now.min_ms = rounded(intervals_.min(), 4);
        now.max_ms = rounded(intervals_.max(), 4);
        now.stddev_ms = rounded(intervals_.standard_deviation(), 4);
        return cles::to_json(now);
    }

  private:
    statistics intervals_;
    std::optional<steady::time_point> last_;
    std::uint64_t updates_ = 0;
    std::uint64_t reported_ = 0;
    std::uint64_t missed_ = 0;
};

/// Measures the rate of each noun, and reports it every second and at its end.
class rate_report {
  public:
    rate_report(client& requester, const hz_arguments& args)
        : requester_(requester), args_(args), timer_(requester.context()) {}
    rate_report(const rate_report&) = delete;
    rate_report& operator=(const rate_report&) = delete;

    asio::awaitable<void> run() {
        std::exception_ptr ended;
        try {
            co_await follow(requester_, args_.feed, on_item_, on_bound_);
        } catch (...) {
            ended = std::current_exception();
        }
        ended_ = true; // a timer that has already expired cannot be cancelled
        timer_.cancel();
        report(); // without a binding there is nothing to report
        if (ended) {
            std::rethrow_exception(ended);
        }
    }

  private:
    bool take(const std::string& noun, const feed_set::item& item) {
        auto& meter = meters_.at(noun);
        if (item.kind == cles::feed_event::update) {
            meter.count(steady::now());
            ++updates_;
        } else {
            meter.take(item);
            note_event(noun, item);
        }
        return args_.feed.count == 0 || updates_ < args_.feed.count;
    }

    void begin(const std::string& noun) {
        const bool is_first = meters_.empty();
        meters_.try_emplace(noun, args_.window);
        if (is_first) {
            next_report_ = steady::now();
            report_every_second();
        }
    }

    void report_every_second() {
        next_report_ += 1s;
        timer_.expires_at(next_report_);
        timer_.async_wait([this](boost::system::error_code code) {
            if (code || ended_) {
                return;
            }
            try {
                report();
            } catch (...) { // the reader is gone, which the client detects
                return;
            }
            report_every_second();
        });
    }

    void report() {
        std::string out;
        for (auto& [noun, meter] : meters_) {
            if (!args_.feed.is_of_many()) {
                out += args_.json ? meter.json() + "\n" : meter.text();
            } else if (args_.json) {
                out += R"({"noun":)" + cles::to_json(noun) + "," + meter.json().substr(1) + "\n";
            } else {
                out += noun + ": " + meter.text();
            }
        }
        if (!out.empty()) {
            write_output(out);
        }
    }

    client& requester_;
    const hz_arguments& args_;
    const feed_set::receiver on_item_ = [this](const std::string& noun, const feed_set::item& item) {
        return take(noun, item);
    };
    const std::function<void(const std::string&)> on_bound_ = [this](const std::string& noun) { begin(noun); };
    asio::steady_timer timer_;
    std::map<std::string, rate_meter> meters_; // by noun
    steady::time_point next_report_;
    std::uint64_t updates_ = 0; // of all
    bool ended_ = false;
};

} // namespace

void add_hz(CLI::App& app, context& shared) {
    auto args = std::make_shared<hz_arguments>();
    auto* command = app.add_subcommand("hz", "Measure the rate of updates");
    args->feed.add_options(*command, "End after this number of updates; 0: until interrupted (default 0)")->required();
    command->add_flag("--wait", args->feed.waits, "Wait for nodes and nouns that are not there yet");
    command->add_option("-w,--window", args->window, "Number of intervals for the statistics (default 1000)")
        ->type_name("N")
        ->check(CLI::Range(1, 10'000'000).description(""));
    add_json_option(*command, args->json, "a document per line");
    command->footer(
        "Prints a line each second, and one at the end; of several nouns, and those that match patterns, a\n"
        "line for each.\n\n"
        "Examples:\n"
        "  cles hz car1:localization\n"
        "  cles hz car1:localization 'all:tyre/**' --wait\n"
        "  cles hz car1:localization --duration 10s -o json | tail -1 | jq .rate");
    command->callback([args, &shared] {
        args->feed.check();
        client requester{args->feed.addresses, shared.verbosity, args->feed.uses_multicast()};
        args->feed.prepare(requester);
        rate_report report{requester, *args};
        shared.exit_code = requester.run(report.run());
    });
}

} // namespace tool
