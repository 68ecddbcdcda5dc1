// SPDX-License-Identifier: BSL-1.0
// What `any:` costs: the same PULL with the name of a node and with `any`, by a node that is linked to a hundred
// others. Prints medians of the rounds.
//
//   cles_any_cost
#include <cles/gossip.hpp>
#include <cles/routing.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

namespace perf = cles::perf;
using namespace std::chrono_literals;
using clock_type = std::chrono::steady_clock;

constexpr int nodes = 100;
constexpr int rounds = 9;
constexpr int blocks = 20; // of each kind in a round, in turn, so that a disturbance affects both
constexpr std::size_t block = 200;

std::string name_of(int number) { return "car" + std::to_string(number); }

void run_hub(const perf::child_process::announce& announce) {
    boost::asio::io_context io{1};
    cles::service hub{
        io, {.name = "hub", .listen = {"tcp://127.0.0.1:0"}, .gossip = cles::gossip(), .routing = cles::routing()}};
    announce(hub.endpoints().front());
    cles::run(io, {});
}

void run_cars(const std::string& seed, const perf::child_process::announce& announce) {
    boost::asio::io_context io{1};
    std::vector<std::unique_ptr<cles::service>> cars;
    for (int i = 1; i <= nodes; ++i) {
        cars.push_back(std::make_unique<cles::service>(io, cles::service_options{.name = name_of(i),
                                                                                 .listen = {"tcp://127.0.0.1:0"},
                                                                                 .gossip = cles::gossip({seed})}));
        cars.back()->on_pull("speed", [] { return 21.5; });
    }
    announce("there");
    cles::run(io, {});
}

class client {
  public:
    explicit client(std::string hub) : by_hub_(cles::call_options{}.at(hub)) {}

    void pull(const std::string& noun) { service_.request("PULL " + noun, by_hub_); }
    void time(const std::function<std::string()>& next, perf::latency_recorder& record) {
        for (std::size_t i = 0; i < block; ++i) {
            const auto noun = next();
            const auto begun = clock_type::now();
            pull(noun);
            record.record(clock_type::now() - begun);
        }
    }

  private:
    boost::asio::io_context io_{1};
    cles::service service_{io_, {.name = "bench"}};
    cles::call_options by_hub_;
};

// Each has been asked for what it offers when each has been reached by its name, and has had time to say so.
void wait_for_all(client& asks) {
    const auto limit = clock_type::now() + 60s;
    for (int i = 1; i <= nodes;) {
        try {
            asks.pull(name_of(i) + ":speed");
            ++i;
        } catch (const cles::error& not_yet) {
            if (clock_type::now() > limit) {
                throw;
            }
            std::this_thread::sleep_for(50ms);
        }
    }
}

int measure() {
    const auto ends = perf::place_ends();
    perf::child_process hub{ends.server, run_hub};
    const auto where = hub.announced();
    perf::child_process cars{ends.client,
                             [&](const perf::child_process::announce& announce) { run_cars(where, announce); }};
    cars.announced();
    perf::pin_to(ends.client);
    client asks{where};
    wait_for_all(asks);

    int number = 0;
    const auto named = [&] { return name_of(number = number % nodes + 1) + ":speed"; };
    const auto any = [] { return std::string{"any:speed"}; };
    std::vector<double> named_us, any_us, ratio;
    for (int round = 0; round <= rounds; ++round) {
        perf::latency_recorder with_name{blocks * block};
        perf::latency_recorder with_any{blocks * block};
        for (int i = 0; i < blocks; ++i) {
            asks.time(named, with_name);
            asks.time(any, with_any);
        }
        if (round == 0) {
            continue; // to warm up
        }
        named_us.push_back(with_name.quantiles().p50);
        any_us.push_back(with_any.quantiles().p50);
        ratio.push_back(any_us.back() / named_us.back());
    }
    for (auto* each : {&named_us, &any_us, &ratio}) {
        std::sort(each->begin(), each->end());
    }
    std::printf("PULL by name, p50     %8.1f us\n", named_us[rounds / 2]);
    std::printf("PULL any:, p50        %8.1f us  %.3fx (%.3f to %.3f)\n", any_us[rounds / 2], ratio[rounds / 2],
                ratio.front(), ratio.back());
    return 0;
}

} // namespace

int main() {
    try {
        return measure();
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "cles_any_cost: %s\n", failed.what());
        return 1;
    }
}
