// SPDX-License-Identifier: BSL-1.0
// What an empty job costs: DELEGATE to the task of a plugin on a daemon's workers over TCP, and the hand-written
// exchange in the same round. Prints medians of the rounds.
//
//   cles_job_cost PLUGIN [--workers N] [--rounds N] [--spread] [--busy-poll US]
//
// The client has one core and all of the daemon another; with --spread the daemon's threads may run on all cores.
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "delegate_load.hpp"
#include "job_daemon.hpp"
#include "perf/baseline/exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

namespace perf = cles::perf;

constexpr std::size_t singles = 5'000;
constexpr std::size_t many = 200'000;
constexpr std::size_t in_flight = 64;

struct options {
    std::string plugin;
    unsigned workers = 2;
    unsigned rounds = 5;
    unsigned busy_poll_us = 0;
    bool spread = false;
};

options read(std::span<char*> arguments) {
    options o;
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const std::string_view option = arguments[i];
        if (option == "--spread") {
            o.spread = true;
        } else if ((option == "--workers" || option == "--rounds" || option == "--busy-poll") &&
                   i + 1 < arguments.size()) {
            const std::string_view text = arguments[++i];
            auto& number = option == "--workers" ? o.workers : option == "--rounds" ? o.rounds : o.busy_poll_us;
            const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), number);
            if (wrong != std::errc{} || end != text.data() + text.size() || number > 1000 ||
                (number == 0 && option != "--busy-poll")) {
                throw std::invalid_argument(std::string{option} + " takes a number up to 1000");
            }
        } else if (!option.starts_with('-') && o.plugin.empty()) {
            o.plugin = option;
        } else {
            throw std::invalid_argument("'" + std::string{option} + "' is not an option");
        }
    }
    if (o.plugin.empty()) {
        throw std::invalid_argument(
            "usage: cles_job_cost PLUGIN [--workers N] [--rounds N] [--spread] [--busy-poll US]");
    }
    return o;
}

cles::run_options polling(const options& o) { return {.busy_poll = std::chrono::microseconds{o.busy_poll_us}}; }

int measure(const options& o) {
    const auto ends = perf::place_ends();
    perf::child_process hand{ends.server, [](const perf::child_process::announce& announce) {
                                 perf::icd::server packets{cles::parse_url("tcp://127.0.0.1:0")};
                                 announce(to_string(packets.where()));
                                 packets.run();
                             }};
    const auto cores = o.spread ? perf::usable_cores() : std::vector{ends.server};
    perf::child_process node{ends.server, [&](const perf::child_process::announce& announce) {
                                 perf::run_daemon({.path = o.plugin}, o.workers, cores, polling(o), announce);
                             }};
    perf::icd::client by_hand{cles::parse_url(hand.announced())};
    perf::pin_to(ends.client);
    boost::asio::io_context io{1};
    cles::service client{io, {.name = "bench", .peers = {{"car1", node.announced()}}}};
    perf::delegate_load jobs{io, client, "car1:empty", polling(o)};

    std::vector<double> packet_us, job_us, ratio, rate;
    for (unsigned round = 0; round <= o.rounds; ++round) {
        perf::latency_recorder packets{singles};
        while (!packets.full()) {
            const auto begun = std::chrono::steady_clock::now();
            (void)by_hand.pull();
            packets.record(std::chrono::steady_clock::now() - begun);
        }
        perf::latency_recorder single{singles};
        jobs.run(1, single);
        perf::latency_recorder crowd{many};
        const std::chrono::duration<double> took = jobs.run(in_flight, crowd);
        if (round == 0) {
            continue; // to warm up
        }
        packet_us.push_back(packets.quantiles().p50);
        job_us.push_back(single.quantiles().p50);
        ratio.push_back(job_us.back() / packet_us.back());
        rate.push_back(static_cast<double>(many) / took.count());
    }
    std::printf("hand-written exchange, p50     %8.1f us\n", perf::median(packet_us));
    std::printf("empty job, p50                 %8.1f us  %.2fx (%.2f to %.2f)\n", perf::median(job_us),
                perf::median(ratio), *std::min_element(ratio.begin(), ratio.end()),
                *std::max_element(ratio.begin(), ratio.end()));
    std::printf("empty jobs, %zu in flight       %8.0f a second\n", in_flight, perf::median(rate));
    return 0;
}

} // namespace

int main(int argc, char** argv) {
    try {
        return measure(read({argv, static_cast<std::size_t>(argc)}));
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "cles_job_cost: %s\n", failed.what());
        return 1;
    }
}
