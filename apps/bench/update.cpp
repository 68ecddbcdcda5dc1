// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "figures.hpp"
#include "measurements.hpp"
#include "perf/fan_out/update_exchange.hpp"
#include "perf/messages/byte_tap.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/clock.hpp"
#include "perf/support/pinning.hpp"
#include "progress.hpp"
#include "report_table.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

namespace tool {

namespace perf = cles::perf;

namespace {

/// One pass, or the medians over all. All times are in microseconds.
struct update_figures {
    double deliveries_per_s = 0;
    double updates_per_s = 0;
    double cpu_us = 0; ///< per delivery
    double cpu_binder_us = 0;
    double cpu_publisher_us = 0;
    std::uint64_t missed = 0; ///< in all passes together
};
BOOST_DESCRIBE_STRUCT(update_figures, (),
                      (deliveries_per_s, updates_per_s, cpu_us, cpu_binder_us, cpu_publisher_us, missed))

struct update_report {
    std::string bench = "updates";
    std::string transport{};
    std::string style{};
    std::size_t binders = 1;
    std::size_t rounds = 0;
    std::uint64_t updates = 0; ///< published in each pass
    std::int64_t busy_poll_us = 0;
    std::optional<std::int64_t> wake_within_us{}; ///< nothing: as the host has it
    int client_core = 0;
    int server_core = 0;
    std::optional<double> update_bytes{};
    update_figures raw{};
    update_figures typed{};
};
BOOST_DESCRIBE_STRUCT(update_report, (),
                      (bench, transport, style, binders, rounds, updates, busy_poll_us, wake_within_us, client_core,
                       server_core, update_bytes, raw, typed))

std::vector<std::string> cells_of(std::string name, const update_figures& figures) {
    return {std::move(name),
            fixed(figures.deliveries_per_s, 0),
            fixed(figures.updates_per_s, 0),
            fixed(figures.cpu_binder_us, 3),
            fixed(figures.cpu_publisher_us, 3),
            std::to_string(figures.missed)};
}

update_figures median_of(const std::vector<update_figures>& passes) {
    using figures = update_figures;
    const medians of{passes};
    update_figures result{.deliveries_per_s = of(&figures::deliveries_per_s),
                          .updates_per_s = of(&figures::updates_per_s),
                          .cpu_us = of(&figures::cpu_us),
                          .cpu_binder_us = of(&figures::cpu_binder_us),
                          .cpu_publisher_us = of(&figures::cpu_publisher_us)};
    for (const auto& pass : passes) {
        result.missed += pass.missed;
    }
    return result;
}

std::string table_of(const update_report& report) {
    rows out{{"UPDATE localization", "deliveries/s", "updates/s", "subscriber CPU us", "publisher CPU us", "missed"}};
    out.add(cells_of("raw (json_text)", report.raw));
    out.add(cells_of("typed (struct)", report.typed));
    return out.text() + "medians of " + std::to_string(report.rounds) + " rounds of " + std::to_string(report.updates) +
           " updates over " + report.transport + " to " + std::to_string(report.binders) + " subscriber" +
           (report.binders == 1 ? "" : "s") + ", " + styles(report.style) +
           waiting(report.busy_poll_us, report.wake_within_us) + ", " + fixed(report.update_bytes, 1) +
           " bytes per update, CPU per delivery; " + cores(report.client_core, report.server_core) + "\n";
}

constexpr std::uint64_t deliveries_of_a_pass = 4'000'000;
constexpr std::uint64_t max_updates = 1'000'000;
constexpr std::uint64_t counted_updates = 5'000;

std::uint64_t updates_of(const bench_options& options) {
    return options.requests != 0
               ? options.requests
               : std::clamp<std::uint64_t>(deliveries_of_a_pass / options.binders.front(), 1, max_updates);
}

using clients = std::vector<std::unique_ptr<cles::service>>;

clients clients_of(boost::asio::io_context& io, const std::string& url, std::size_t count) {
    clients all;
    for (std::size_t i = 0; i < count; ++i) {
        cles::service_options options{.name = "bench" + std::to_string(i), .peers = {{"car1", url}}};
        all.push_back(std::make_unique<cles::service>(io, std::move(options)));
    }
    return all;
}

double count_bytes(const std::string& url) {
    perf::byte_tap tap{cles::parse_url(url)};
    boost::asio::io_context io{1};
    perf::take_updates(io, clients_of(io, tap.url(), 1), {.binders = 1, .updates = counted_updates});
    return rounded(static_cast<double>(tap.to_client()) / static_cast<double>(counted_updates));
}

update_figures take(boost::asio::io_context& io, const clients& binders, pid_t publisher,
                    const perf::update_load& load) {
    const auto publisher_before = perf::cpu_used(publisher);
    const auto binder_before = perf::cpu_used(::getpid());
    const auto tally = perf::take_updates(io, binders, load);
    const auto binder = perf::cpu_used(::getpid()) - binder_before;
    const auto published = perf::cpu_used(publisher) - publisher_before;

    const auto count = static_cast<double>(tally.delivered);
    const double seconds = microseconds(tally.took) / 1e6;
    update_figures figures;
    figures.deliveries_per_s = count / seconds;
    figures.updates_per_s = static_cast<double>(load.updates) / seconds;
    figures.cpu_binder_us = microseconds(binder) / count;
    figures.cpu_publisher_us = microseconds(published) / count;
    figures.cpu_us = figures.cpu_binder_us + figures.cpu_publisher_us;
    figures.missed = tally.missed;
    return figures;
}

} // namespace

std::string measure_updates(const bench_options& options) {
    const auto cores = places_of(options);
    perf::child_process publisher{cores.server, [&](const perf::child_process::announce& announce) {
                                      perf::serve_updates(bench_url(options.transport), options.how, announce);
                                  }};
    const auto url = publisher.announced();
    perf::pin_to(cores.client);

    boost::asio::io_context io{1};
    const auto binders = clients_of(io, url, options.binders.front());

    std::vector<update_figures> raw;
    std::vector<update_figures> typed;
    perf::update_load load{.binders = options.binders.front(),
                           .updates = updates_of(options),
                           .style = options.style,
                           .how = options.how,
                           .keep = options.keep};
    bench_progress progress{options.rounds * 2};
    for (std::size_t round = 0; round < options.rounds; ++round) {
        progress.step("updates as text");
        load.form = perf::value_form::raw;
        raw.push_back(take(io, binders, publisher.id(), load));
        progress.step("updates as C++ values");
        load.form = perf::value_form::typed;
        typed.push_back(take(io, binders, publisher.id(), load));
    }

    update_report report{.transport = to_string(options.transport),
                         .style = to_string(options.style),
                         .binders = options.binders.front(),
                         .rounds = options.rounds,
                         .updates = load.updates,
                         .busy_poll_us = options.how.busy_poll.count(),
                         .wake_within_us = wake_within_us(options),
                         .client_core = cores.client,
                         .server_core = cores.server,
                         .update_bytes = count_bytes(url),
                         .raw = median_of(raw),
                         .typed = median_of(typed)};
    return text_of(report, options);
}

} // namespace tool
