// SPDX-License-Identifier: BSL-1.0
#include "bench_arguments.hpp"

#include "options/duration.hpp"
#include "output/errors.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <map>

namespace tool {
namespace {

constexpr std::size_t most_in_flight = 4096;
constexpr std::size_t most_binders = 1024;
constexpr int most_wait_us = 1'000'000;

const std::map<std::string, carrier> carriers{{"tcp", carrier::tcp},
                                              {"udp", carrier::udp},
                                              {"unix", carrier::unix_socket},
                                              {"inproc", carrier::inproc},
                                              {"multicast", carrier::multicast}};
const std::map<std::string, cles::perf::handler_style> styles{{"coroutine", cles::perf::handler_style::coroutine},
                                                              {"callback", cles::perf::handler_style::callback}};

template <class Map>
std::vector<std::string> keys_of(const Map& choices) {
    std::vector<std::string> keys;
    keys.reserve(choices.size());
    for (const auto& choice : choices) {
        keys.push_back(choice.first);
    }
    return keys;
}

/// A flag that asks for another measurement than that of PULLs, and what has no meaning beside it.
struct mode {
    const char* flag;
    const char* help;
    measurement what;
    std::vector<const char*> refused;
    std::vector<carrier> carried_by;
    const char* carried_why; ///< and not by others
};

const std::vector<mode> modes{
    {"--stress",
     "Measure the tail of PULL's latency while other processes want all cores, with and without real-time scheduling",
     measurement::stress,
     {"--against", "--binders", "--keep"},
     {carrier::tcp, carrier::udp, carrier::unix_socket},
     "goes from one process to another: --transport tcp, udp or unix"},
    {"--urgent",
     "Measure PULL beside large answers of the same node, in its turn and urgently",
     measurement::urgent,
     {"--against", "--binders", "--keep"},
     {carrier::tcp, carrier::unix_socket},
     "is for streams, on which large answers go: --transport tcp or unix"},
    {"--fan-out",
     "Measure the way of an UPDATE to many binders, paced and as fast as possible, against the same by hand",
     measurement::fan_out,
     {"--in-flight", "--against", "--duration"},
     {carrier::tcp, carrier::unix_socket, carrier::multicast},
     "has a baseline for --transport tcp, unix and multicast only"},
    {"--updates",
     "Measure UPDATE to binders that miss nothing instead of PULL",
     measurement::updates,
     {"--in-flight", "--against", "--duration"},
     {carrier::tcp, carrier::unix_socket},
     "goes from one process to another, and every update must come: --transport tcp or unix"},
    {"--bytes",
     "Count what each verb puts on the wire, over TCP and UDP, against the packed struct",
     measurement::bytes,
     {"--transport", "--in-flight", "--against", "--duration", "--rounds", "--style", "--busy-poll", "--wake-within",
      "--one-core", "--binders", "--keep"},
     {carrier::tcp},
     ""},
    {"--parse",
     "Measure what requests and replies from 64 bytes to 1 MiB cost by their length, without sockets, beside the "
     "packed struct",
     measurement::parse,
     {"--transport", "--in-flight", "--against", "--duration", "--style", "--busy-poll", "--wake-within", "--one-core",
      "--binders", "--keep"},
     {carrier::tcp},
     ""},
};

bool is_given(const CLI::App& command, const char* option) { return command.count(option) != 0; }

[[noreturn]] void refuse(const std::string& option, const std::string& why) { throw usage_error(option + " " + why); }

void settle_mode(const CLI::App& command, bench_arguments& given) {
    const auto asked =
        std::find_if(modes.begin(), modes.end(), [&](const mode& each) { return is_given(command, each.flag); });
    if (asked == modes.end()) {
        for (const char* option : {"--binders", "--keep"}) {
            if (is_given(command, option)) {
                refuse(option, "is for --updates and --fan-out");
            }
        }
        if (given.options.transport == carrier::multicast) {
            refuse("--transport multicast", "is for --fan-out");
        }
        return;
    }
    given.what = asked->what;
    const std::string not_for = std::string{"is not for "} + asked->flag;
    for (const auto& other : modes) {
        if (&other != &*asked && is_given(command, other.flag)) {
            refuse(other.flag, not_for);
        }
    }
    for (const char* option : asked->refused) {
        if (is_given(command, option)) {
            refuse(option, not_for);
        }
    }
    const auto& fit = asked->carried_by;
    if (std::find(fit.begin(), fit.end(), given.options.transport) == fit.end()) {
        refuse(asked->flag, asked->carried_why);
    }
}

void settle_binders(bench_arguments& given) {
    auto& binders = given.options.binders;
    if (!given.binders.empty()) {
        binders = given.binders;
    } else if (given.what == measurement::fan_out) {
        binders = {1, 8, 64};
    }
    if (given.options.transport == carrier::multicast && given.options.keep != 0) {
        refuse("--keep", "has no effect by multicast");
    }
    if (given.what == measurement::updates && binders.size() != 1) {
        refuse("--updates", "takes one number of --binders");
    }
}

} // namespace

void add_bench_arguments(CLI::App& command, bench_arguments& given) {
    auto& options = given.options;
    command
        .add_option("--transport", given.transport,
                    "What carries the CLES exchange: tcp, udp, unix or inproc; with --fan-out tcp, unix or multicast")
        ->check(CLI::IsMember(keys_of(carriers)).description(""))
        ->type_name("NAME");
    command.add_option("--in-flight", options.in_flight, "PULLs in flight at once on one link (1)")
        ->check(CLI::Range(std::size_t{1}, most_in_flight).description(""))
        ->type_name("N");
    command.add_option("--against", options.against, "A node that runs already and offers localization")
        ->type_name("URL");
    auto* requests =
        command.add_option("--requests", options.requests,
                           "Requests, or with --updates and --fan-out updates, in each pass (50000; "
                           "1000000 where many are in flight or published; the baseline at most 50000 "
                           "then; with --fan-out 1000 paced; with --bytes 2000; with --parse 8 MiB of them)");
    requests->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}).description(""))->type_name("N");
    command.add_option("--duration", given.duration, "How long each pass takes, instead of --requests")
        ->excludes(requests)
        ->type_name("TIME");
    command.add_option("--rounds", options.rounds, "Passes of each exchange, of which the medians are taken (5)")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000}).description(""))
        ->type_name("N");
    command.add_option("--style", given.style, "How results reach the caller's code: coroutine or callback")
        ->check(CLI::IsMember(keys_of(styles)).description(""))
        ->type_name("NAME");
    command
        .add_option("--busy-poll", given.busy_poll_us,
                    "Let both ends of CLES look for work so long before they sleep, in microseconds (0)")
        ->check(CLI::Range(0, most_wait_us).description(""))
        ->type_name("US");
    command
        .add_option("--wake-within", given.wake_within_us,
                    "Let this host's cores, in all that is measured, sleep no deeper than they wake from in so many "
                    "microseconds; 0: not at all (it takes /dev/cpu_dma_latency)")
        ->check(CLI::Range(0, most_wait_us).description(""))
        ->type_name("US");
    command.add_flag("--one-core", options.one_core, "Put both ends on one core");
    for (const auto& each : modes) {
        command.add_flag(each.flag, each.help);
    }
    command
        .add_option("--binders", given.binders,
                    "Bindings, each on a link of its own (1); with --fan-out several numbers (1,8,64)")
        ->delimiter(',')
        ->check(CLI::Range(std::size_t{1}, most_binders).description(""))
        ->type_name("N");
    command.add_option("--keep", options.keep, "Updates that the publisher queues for each binder (64)")
        ->check(CLI::Range(std::uint32_t{1}, std::uint32_t{65536}).description(""))
        ->type_name("N");
    command.add_option("-o,--output", given.form, "table or json (table)")
        ->check(CLI::IsMember({"table", "json"}).description(""))
        ->type_name("FORM");
}

void settle(const CLI::App& command, bench_arguments& given) {
    given.options.transport = carriers.at(given.transport);
    given.options.style = styles.at(given.style);
    given.options.how.busy_poll = std::chrono::microseconds{given.busy_poll_us};
    if (given.wake_within_us) {
        given.options.wake_within = std::chrono::microseconds{*given.wake_within_us};
    }
    settle_mode(command, given);
    settle_binders(given);
    if (!given.options.against.empty() && is_given(command, "--transport")) {
        refuse("--transport", "is told by the URL of --against");
    }
    if (!given.duration.empty()) {
        given.options.duration = parse_positive_duration(given.duration);
    }
}

} // namespace tool
