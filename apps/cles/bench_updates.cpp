// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "bench_medians.hpp"
#include "bench_progress.hpp"
#include "bench_run.hpp"
#include "perf/fan_out/update_exchange.hpp"
#include "perf/messages/byte_tap.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/clock.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>

namespace tool {

namespace perf = cles::perf;

namespace {

constexpr std::uint64_t deliveries_of_a_pass = 4'000'000;
constexpr std::uint64_t most_updates = 1'000'000;
constexpr std::uint64_t updates_whose_bytes_count = 5'000;

std::uint64_t updates_of(const bench_options& options) {
    return options.requests != 0
               ? options.requests
               : std::clamp<std::uint64_t>(deliveries_of_a_pass / options.binders.front(), 1, most_updates);
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
    perf::take_updates(io, clients_of(io, tap.url(), 1), {.binders = 1, .updates = updates_whose_bytes_count});
    return rounded(static_cast<double>(tap.to_client()) / static_cast<double>(updates_whose_bytes_count));
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

update_report bench_updates(const bench_options& options) {
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
    return report;
}

} // namespace tool
