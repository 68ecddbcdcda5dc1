// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>

#include "client/member_key.hpp"
#include "figures.hpp"
#include "measurements.hpp"
#include "perf/baseline/exchange.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/messages/byte_tap.hpp"
#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/clock.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"
#include "progress.hpp"
#include "pull_report.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>

#include <unistd.h>

namespace tool {

namespace perf = cles::perf;
using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t requests_alone = 50'000;
constexpr std::uint64_t requests_in_flight = 1'000'000;
// The capacity for a pass of limited duration: more than a second can bring, but limited by memory.
constexpr std::uint64_t max_per_second_alone = 1'000'000;
constexpr std::uint64_t max_per_second_in_flight = 4'000'000;
constexpr std::uint64_t max_recorded = 20'000'000;
constexpr std::uint64_t counted_pulls = 5'000;

std::uint64_t requests_of(const bench_options& options) {
    if (options.requests != 0) {
        return options.requests;
    }
    const bool alone = options.in_flight == 1;
    if (options.duration) {
        const auto ms = static_cast<std::uint64_t>(options.duration->count());
        return std::min(max_recorded, ms * (alone ? max_per_second_alone : max_per_second_in_flight) / 1000);
    }
    return alone ? requests_alone : requests_in_flight;
}

/// Measures one pass: what it took, on whose processor.
class pass_meter {
  public:
    explicit pass_meter(std::optional<pid_t> server) : server_(server) {}

    template <class Pass>
    exchange_figures measure(perf::latency_recorder& record, Pass&& run) const {
        const auto server_before = server_ ? perf::cpu_used(*server_) : 0ns;
        const auto client_before = perf::cpu_used(::getpid());
        const std::chrono::nanoseconds took = run();
        const auto client = perf::cpu_used(::getpid()) - client_before;
        const auto count = static_cast<double>(record.count());
        exchange_figures figures;
        if (server_) {
            figures.cpu_server_us = microseconds(perf::cpu_used(*server_) - server_before) / count;
        }
        const auto quantiles = record.quantiles();
        figures.p50_us = quantiles.p50;
        figures.p99_us = quantiles.p99;
        figures.p999_us = quantiles.p999;
        figures.max_us = quantiles.max;
        figures.requests_per_s = count / (microseconds(took) / 1e6);
        figures.cpu_client_us = microseconds(client) / count;
        return figures;
    }

  private:
    std::optional<pid_t> server_;
};

std::chrono::nanoseconds pull_by_hand(perf::icd::client& client, std::chrono::nanoseconds at_most,
                                      perf::latency_recorder& record) {
    using clock = std::chrono::steady_clock;
    record.clear();
    const auto first = clock::now();
    for (auto began = first;;) {
        const auto value = client.pull();
        const auto now = clock::now();
        if (!perf::is_sample(value)) {
            throw std::runtime_error("the hand-written exchange changed the values");
        }
        record.record(now - began);
        if (record.full() || now - first >= at_most) {
            return now - first;
        }
        began = now;
    }
}

/// Sends some requests over a link that counts its bytes.
void count_bytes(const std::string& url, const std::string& node, const std::string& noun, const bench_options& options,
                 exchange_figures& figures) {
    perf::byte_tap tap{cles::parse_url(url)};
    boost::asio::io_context io{1};
    cles::service client{io, {.name = "bench", .peers = {{node, tap.url()}}}};
    perf::pull_load load{io, client, noun, options.style, false};
    perf::latency_recorder record{counted_pulls};
    load.run(1, std::chrono::nanoseconds::max(), record);
    figures.request_bytes = rounded(static_cast<double>(tap.to_server()) / static_cast<double>(counted_pulls));
    figures.reply_bytes = rounded(static_cast<double>(tap.to_client()) / static_cast<double>(counted_pulls));
}

struct named_node {
    std::string node;
};
BOOST_DESCRIBE_STRUCT(named_node, (), (node))

cles::service_options requester(const bench_options& options) {
    cles::service_options out{.name = "bench"};
    if (!options.keys.empty()) {
        use_member_key(out, options.keys);
    }
    return out;
}

std::string name_of_node(const bench_options& options) {
    boost::asio::io_context io{1};
    cles::service client{io, requester(options)};
    return cles::from_json<named_node>(client.request("PULL self:cles", cles::call_options{}.at(options.against))).node;
}

/// The hand-written exchange, both ends.
class baseline {
  public:
    baseline(int core, const std::string& url)
        : server_(core,
                  [&](const perf::child_process::announce& announce) {
                      perf::icd::server server{cles::parse_url(url)};
                      announce(to_string(server.where()));
                      server.run();
                  }),
          client_(cles::parse_url(server_.announced())) {}

    exchange_figures pass(std::chrono::nanoseconds at_most, perf::latency_recorder& record) {
        auto figures = pass_meter{server_.id()}.measure(record, [&] { return pull_by_hand(client_, at_most, record); });
        figures.cpu_us = figures.cpu_client_us + *figures.cpu_server_us;
        figures.request_bytes = sizeof(perf::icd::request_packet);
        figures.reply_bytes = sizeof(perf::icd::reply_packet);
        return figures;
    }

  private:
    perf::child_process server_;
    perf::icd::client client_;
};

} // namespace

std::string measure_pulls(const bench_options& options) {
    const bool remote = !options.against.empty();
    const bool inproc = !remote && options.transport == carrier::inproc;
    const auto cores = places_of(options);

    // Before this process has anything that the children would inherit.
    std::unique_ptr<baseline> by_hand;
    std::unique_ptr<baseline> by_hand_same; // over the transport of CLES, to see what the sockets cost
    std::unique_ptr<perf::child_process> server;
    std::string url = options.against;
    if (!remote) {
        by_hand = std::make_unique<baseline>(cores.server, bench_url(carrier::tcp));
        url = bench_url(options.transport);
    }
    if (!remote && options.transport == carrier::unix_socket) {
        by_hand_same = std::make_unique<baseline>(cores.server, url + "-by-hand");
    } else if (!remote && options.transport == carrier::udp) {
        by_hand_same = std::make_unique<baseline>(cores.server, url);
    }
    if (!remote && !inproc) {
        server =
            std::make_unique<perf::child_process>(cores.server, [&](const perf::child_process::announce& announce) {
                perf::serve_localization(url, options.how, announce);
            });
        url = server->announced();
    }
    perf::pin_to(cores.client);

    boost::asio::io_context io{1};
    std::unique_ptr<cles::service> neighbour;
    if (inproc) {
        neighbour = std::make_unique<cles::service>(io, cles::service_options{.name = "car1", .listen = {url}});
        perf::register_localization(*neighbour);
    }
    const std::string node = remote ? name_of_node(options) : "car1";
    const std::string noun = node + ":localization";
    auto asking = requester(options);
    asking.peers.emplace(node, url);
    cles::service client{io, asking};
    perf::pull_load load{io, client, noun, options.style, !remote, options.how};

    const auto requests = requests_of(options);
    perf::latency_recorder record{requests};
    perf::latency_recorder warm_up{std::clamp<std::uint64_t>(requests / 10, 1, 20'000)};
    // The baseline has one in flight and would take minutes for as many as a link full of them.
    const auto by_hand_requests = options.in_flight == 1 ? requests : std::min(requests, requests_alone);
    perf::latency_recorder by_hand_record{by_hand_requests};
    perf::latency_recorder by_hand_warm_up{std::max<std::uint64_t>(1, by_hand_requests / 10)};
    const auto limit = limit_of(options);
    const pass_meter meter{server ? std::optional{server->id()} : std::nullopt};

    std::vector<exchange_figures> hand_written;
    std::vector<exchange_figures> hand_written_same;
    std::vector<exchange_figures> ours;
    pull_report report{.transport = remote ? cles::parse_url(url).scheme : to_string(options.transport),
                       .style = to_string(options.style),
                       .in_flight = options.in_flight,
                       .rounds = options.rounds,
                       .busy_poll_us = options.how.busy_poll.count(),
                       .wake_within_us = wake_within_us(options),
                       .client_core = cores.client};
    const std::size_t exchanges = 1U + (by_hand ? 1U : 0U) + (by_hand_same ? 1U : 0U);
    bench_progress progress{options.rounds * exchanges};
    for (std::size_t round = 0; round < options.rounds; ++round) {
        if (by_hand) {
            progress.step("hand-written exchange");
            by_hand->pass(limit, by_hand_warm_up);
            hand_written.push_back(by_hand->pass(limit, by_hand_record));
        }
        if (by_hand_same) {
            progress.step("hand-written exchange over " + report.transport);
            by_hand_same->pass(limit, by_hand_warm_up);
            hand_written_same.push_back(by_hand_same->pass(limit, by_hand_record));
        }
        progress.step("CLES");
        load.run(options.in_flight, limit, warm_up);
        ours.push_back(meter.measure(record, [&] { return load.run(options.in_flight, limit, record); }));
        report.requests += record.count();
    }

    report.cles = median_of(ours);
    if (inproc) {
        report.cles.cpu_us = report.cles.cpu_client_us;
    } else if (report.cles.cpu_server_us) {
        report.cles.cpu_us = rounded(report.cles.cpu_client_us + *report.cles.cpu_server_us);
    }
    if (report.transport == "tcp" || report.transport == "unix") {
        count_bytes(url, node, noun, options, report.cles);
    }
    if (remote) {
        report.against = url;
    } else {
        report.server_core = inproc ? std::nullopt : std::optional{cores.server};
        report.icd = median_of(hand_written);
        report.ratio = ratio_of(report.cles, *report.icd);
        if (by_hand_same) {
            (options.transport == carrier::udp ? report.icd_udp : report.icd_unix) = median_of(hand_written_same);
        }
    }
    return text_of(report, options);
}

} // namespace tool
