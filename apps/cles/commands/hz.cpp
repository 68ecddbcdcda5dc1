// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "commands/feed_command.hpp"
#include "commands/feed_events.hpp"
#include "context.hpp"
#include "output/output.hpp"
#include "output/statistics.hpp"

#include <boost/describe.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>

namespace tool {

namespace asio = boost::asio;
using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

namespace {

struct hz_command {
    feed_command feed;
    std::size_t window = 1000;
    bool json = false;
};

struct update_counts {
    std::uint64_t updates = 0;
    std::uint64_t missed = 0;
};
BOOST_DESCRIBE_STRUCT(update_counts, (), (updates, missed))

/// What can be said once there is an interval.
struct update_rate : update_counts {
    double rate = 0;
    double mean_ms = 0;
    double min_ms = 0;
    double max_ms = 0;
    double stddev_ms = 0;
};
BOOST_DESCRIBE_STRUCT(update_rate, (update_counts), (rate, mean_ms, min_ms, max_ms, stddev_ms))

/// Counts updates and says every second, and at its end, how they came.
class rate_meter {
  public:
    rate_meter(client& asker, const hz_command& wanted)
        : asker_(asker), wanted_(wanted), timer_(asker.context()), intervals_(wanted.window) {}
    rate_meter(const rate_meter&) = delete;
    rate_meter& operator=(const rate_meter&) = delete;

    asio::awaitable<void> run() {
        std::exception_ptr ended;
        try {
            co_await measure();
        } catch (...) {
            ended = std::current_exception();
        }
        ended_ = true; // a timer that has expired already cannot be cancelled
        timer_.cancel();
        // A binding that was never made has nothing to sum up.
        if (bound_) {
            report();
        }
        if (ended) {
            std::rethrow_exception(ended);
        }
    }

  private:
    asio::awaitable<void> measure() {
        const auto options = wanted_.feed.options(asker_);
        auto feed = co_await asker_.node().async_bind(wanted_.feed.noun, options);
        bound_ = true;
        next_report_ = steady::now();
        report_every_second();
        while (wanted_.feed.count == 0 || updates_ < wanted_.feed.count) {
            const auto item = co_await feed.async_next();
            if (item.kind == cles::feed_event::update) {
                count();
                continue;
            }
            missed_ += item.missed;
            if (item.kind == cles::feed_event::lost) {
                last_.reset(); // what follows is no interval of the publisher's
            }
            note_event(wanted_.feed.noun, item);
        }
    }

    void count() {
        const auto now = steady::now();
        if (last_) {
            intervals_.add(std::chrono::duration<double, std::milli>{now - *last_}.count());
        }
        last_ = now;
        ++updates_;
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
            } catch (...) { // the reader has gone, which the client notices by itself
                return;
            }
            report_every_second();
        });
    }

    void report() {
        const bool silent = updates_ == reported_;
        reported_ = updates_;
        if (wanted_.json) {
            write_output(as_json() + "\n");
            return;
        }
        const auto counted = std::to_string(updates_) + (updates_ == 1 ? " update" : " updates") + ", missed " +
                             std::to_string(missed_) + "\n";
        if (silent || intervals_.empty()) {
            write_output((silent ? "no update since the last line; " : "") + counted);
            return;
        }
        write_output(fixed(1000 / intervals_.mean(), 2) + " updates/s; interval mean " + fixed(intervals_.mean(), 3) +
                     " min " + fixed(intervals_.min(), 3) + " max " + fixed(intervals_.max(), 3) + " stddev " +
                     fixed(intervals_.deviation(), 3) + " ms over " + std::to_string(intervals_.count()) + "; " +
                     counted);
    }

    [[nodiscard]] std::string as_json() const {
        const update_counts counts{updates_, missed_};
        if (intervals_.empty()) {
            return cles::to_json(counts);
        }
        update_rate now{counts};
        now.rate = rounded(1000 / intervals_.mean(), 3);
        now.mean_ms = rounded(intervals_.mean(), 4);
        now.min_ms = rounded(intervals_.min(), 4);
        now.max_ms = rounded(intervals_.max(), 4);
        now.stddev_ms = rounded(intervals_.deviation(), 4);
        return cles::to_json(now);
    }

    client& asker_;
    const hz_command& wanted_;
    asio::steady_timer timer_;
    statistics intervals_;
    std::optional<steady::time_point> last_;
    steady::time_point next_report_;
    std::uint64_t updates_ = 0;
    std::uint64_t reported_ = 0;
    std::uint64_t missed_ = 0;
    bool bound_ = false;
    bool ended_ = false;
};

} // namespace

void add_hz(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<hz_command>();
    auto* command = app.add_subcommand("hz", "Measure how often updates come");
    wanted->feed.add_options(*command, "End after so many updates; 0: until interrupted (default 0)");
    command->add_option("-w,--window", wanted->window, "Intervals that the figures are about (default 1000)")
        ->type_name("N")
        ->check(CLI::Range(1, 10'000'000).description(""));
    command
        ->add_option_function<std::string>(
            "-o,--output", [wanted](const std::string& name) { wanted->json = name == "json"; },
            "text, or json: a document per line (default text)")
        ->type_name("FORMAT")
        ->check(CLI::IsMember({"text", "json"}).description(""));
    command->footer("A line each second, and one at the end.\n\n"
                    "Examples:\n"
                    "  cles hz car1:localization\n"
                    "  cles hz car1:localization --duration 10s -o json | tail -1 | jq .rate");
    command->callback([wanted, &shared] {
        wanted->feed.check();
        client asker{wanted->feed.addresses, shared.verbosity, wanted->feed.is_multicast()};
        asker.explain_failures_of(wanted->feed.noun);
        wanted->feed.arm(asker);
        rate_meter meter{asker, *wanted};
        shared.exit_code = asker.run(meter.run());
    });
}

} // namespace tool
