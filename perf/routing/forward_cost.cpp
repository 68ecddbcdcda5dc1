// SPDX-License-Identifier: BSL-1.0
// What a node on the way costs: the PULL of the localization packet from the node that has it, and the same through a
// node that forwards it, in turns. Client, forwarder and target are processes of their own, linked by TCP on loopback.
// Prints medians of the rounds.
//
//   cles_forward_cost [--rounds N] [--requests N] [--most RATIO] [--one-core]
//
// The client has one core, the forwarder and the target another, or one each if there are three. With --one-core, all
// have the same one: no core is woken, so only the work counts, and there is no limit unless it is given. Exits with 1
// if the forwarded PULL takes more than RATIO (2.2) times as long, in the median.
#include <cles/routing.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/number_option.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

namespace perf = cles::perf;

constexpr std::size_t blocks = 10; // of each kind in a round, in turn, so that a disturbance affects both

struct options {
    unsigned rounds = 5;
    unsigned requests = 10'000; // of each kind in a round
    std::optional<double> most; // direct PULLs
    bool one_core = false;
};

options read(std::span<char*> arguments) {
    options o;
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const std::string_view option = arguments[i];
        if (option == "--one-core") {
            o.one_core = true;
        } else if (i + 1 == arguments.size()) {
            throw std::invalid_argument(
                "usage: cles_forward_cost [--rounds N] [--requests N] [--most RATIO] [--one-core]");
        } else if (option == "--rounds") {
            o.rounds = perf::number(option, arguments[++i], 1000U);
        } else if (option == "--requests") {
            o.requests = perf::number(option, arguments[++i], 10'000'000U);
        } else if (option == "--most") {
            o.most = perf::number(option, arguments[++i], 1000.0);
        } else {
            throw std::invalid_argument("'" + std::string{option} + "' is not an option");
        }
    }
    if (!o.most && !o.one_core) {
        o.most = 2.2;
    }
    return o;
}

void run_forwarder(const std::string& target, const perf::child_process::announce& announce) {
    boost::asio::io_context io{1};
    cles::service hub{
        io, {.name = "hub", .listen = {"tcp://127.0.0.1:0"}, .peers = {{"car1", target}}, .routing = cles::routing()}};
    announce(hub.endpoints().front());
    cles::run(io, {});
}

/// One kind of PULL: its latencies in a round, and the quantiles of all rounds.
struct exchange {
    perf::pull_load load;
    perf::latency_recorder block;
    perf::latency_recorder round;
    std::vector<double> p50{};
    std::vector<double> p99{};

    exchange(boost::asio::io_context& io, cles::service& client, const options& o)
        : load{io, client, "car1:localization", perf::handler_style::callback, true}, block{o.requests / blocks + 1},
          round{block.remaining() * blocks} {}

    void run_block() {
        load.run(1, std::chrono::minutes{1}, block);
        block.copy_to(round);
    }
    void end_round(bool counts) {
        const auto quantiles = round.quantiles();
        round.clear();
        if (counts) {
            p50.push_back(quantiles.p50);
            p99.push_back(quantiles.p99);
        }
    }
};

int measure(const options& o) {
    const auto cores = perf::usable_cores();
    const auto ends = perf::place_ends();
    const auto third = cores.size() > 2 ? cores[cores.size() - 3] : ends.server;
    const auto core_of = [&](int own) { return o.one_core ? ends.client : own; };
    perf::child_process target{core_of(third), [](const perf::child_process::announce& announce) {
                                   perf::serve_localization("tcp://127.0.0.1:0", {}, announce);
                               }};
    const auto where = target.announced();
    perf::child_process forwarder{
        core_of(ends.server), [&](const perf::child_process::announce& announce) { run_forwarder(where, announce); }};
    const auto hub = forwarder.announced();
    perf::pin_to(ends.client);

    boost::asio::io_context io{1};
    cles::service near{io, {.name = "near", .peers = {{"car1", where}}}};
    cles::service far{io, {.name = "far", .peers = {{"car1", hub}}}};
    exchange direct{io, near, o};
    exchange forwarded{io, far, o};
    std::vector<double> ratio;
    for (unsigned round = 0; round <= o.rounds; ++round) {
        for (std::size_t i = 0; i < blocks; ++i) {
            direct.run_block();
            forwarded.run_block();
        }
        const bool counts = round != 0; // the first one to warm up
        direct.end_round(counts);
        forwarded.end_round(counts);
        if (counts) {
            ratio.push_back(forwarded.p50.back() / direct.p50.back());
        }
    }
    const auto found = perf::median(ratio);
    std::printf("                     p50          p99\n");
    std::printf("PULL, direct     %8.1f us  %8.1f us\n", perf::median(direct.p50), perf::median(direct.p99));
    std::printf("PULL, forwarded  %8.1f us  %8.1f us\n", perf::median(forwarded.p50), perf::median(forwarded.p99));
    std::printf("ratio of p50     %8.2f     (%.2f to %.2f)", found, *std::min_element(ratio.begin(), ratio.end()),
                *std::max_element(ratio.begin(), ratio.end()));
    if (o.most) {
        std::printf(", limit %.2f", *o.most);
    }
    std::printf("\n");
    return !o.most || found <= *o.most ? EXIT_SUCCESS : EXIT_FAILURE;
}

} // namespace

int main(int argc, char** argv) {
    try {
        return measure(read({argv, static_cast<std::size_t>(argc)}));
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "cles_forward_cost: %s\n", failed.what());
        return 1;
    }
}
