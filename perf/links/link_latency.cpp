// SPDX-License-Identifier: BSL-1.0
// The localization packet across a link, by CLES and by hand: each end is a process of its own, on any host.
#include <cles/convert.hpp>

#include "ends.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstddef>
#include <exception>
#include <iostream>
#include <map>
#include <string>
#include <vector>

namespace perf = cles::perf;

namespace {

struct settings {
    std::string what;
    std::string url;
    std::string group = "off";
    int interval_ms = 20;
    std::size_t count = 100;
};

void print(std::string_view url) { std::cout << url << std::endl; }

void serve(const settings& given, std::chrono::milliseconds interval) {
    if (given.what == "pull") {
        perf::serve_replies(given.url, print);
    } else if (given.what == "icd-pull") {
        perf::serve_replies_by_hand(given.url, print);
    } else if (given.what == "update") {
        perf::serve_updates(given.url, given.group, interval, print);
    } else {
        perf::serve_updates_by_hand(given.url, interval, print);
    }
}

using timing = std::vector<double> (*)(const std::string& where, perf::pace how);
const std::map<std::string, timing> timings{{"icd-pull", perf::time_pulls_by_hand},
                                            {"icd-update", perf::time_updates_by_hand},
                                            {"pull", perf::time_pulls},
                                            {"update", perf::time_updates},
                                            {"update-multicast", perf::time_updates_by_multicast}};

} // namespace

int main(int argc, char** argv) {
    CLI::App program{"Times the localization packet across a link, by CLES and by hand."};
    program.require_subcommand(1);
    settings given;
    auto* serving = program.add_subcommand("serve", "The end that has the data; prints its URL, and runs until killed");
    serving->add_option("what", given.what, "pull, update, icd-pull or icd-update")
        ->required()
        ->check(CLI::IsMember({"pull", "update", "icd-pull", "icd-update"}));
    serving->add_option("url", given.url, "Where to listen, such as tcp://10.0.0.1:0")->required();
    serving->add_option("--multicast", given.group, "Of update: IFACE[,GROUP[:PORT]], or off")->capture_default_str();
    auto* asking =
        program.add_subcommand("time", "The end that requests the data; prints microseconds as a JSON array");
    asking->add_option("what", given.what, "pull, update, update-multicast, icd-pull or icd-update")
        ->required()
        ->check(CLI::IsMember({"pull", "update", "update-multicast", "icd-pull", "icd-update"}));
    asking->add_option("where", given.url, "What the other end printed; for update-multicast its group")->required();
    asking->add_option("--count", given.count, "How many")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000}))
        ->capture_default_str();
    for (auto* each : {serving, asking}) {
        each->add_option("--interval", given.interval_ms, "Milliseconds from one update, or PULL, to the next")
            ->check(CLI::Range(1, 10'000))
            ->capture_default_str();
    }
    CLI11_PARSE(program, argc, argv);
    const std::chrono::milliseconds interval{given.interval_ms};
    try {
        if (*serving) {
            serve(given, interval);
        } else {
            const perf::pace how{.count = given.count, .interval = interval};
            std::cout << cles::to_json(timings.at(given.what)(given.url, how)) << '\n';
        }
        return 0;
    } catch (const std::exception& failure) {
        std::cerr << "cles_link_latency: " << failure.what() << '\n';
        return 1;
    }
}
