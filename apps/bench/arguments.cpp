// SPDX-License-Identifier: BSL-1.0
#include "arguments.hpp"

#include "output/errors.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <map>

namespace tool {
namespace {

constexpr const char* bench_description =
    "Measure PULL of a localization packet against a hand-written exchange of packed structs over\n"
    "blocking TCP sockets, both in one run, in turn, each server in a process of its own on another\n"
    "core. With --updates or --fan-out, measure BIND and UPDATE instead; with --stress, the steadiness\n"
    "of PULL; with --urgent, what it takes beside large answers; with --bytes, what all verbs put on the wire; with "
    "--parse, what a message costs by its\n"
    "length.";

constexpr const char* bench_examples = "Examples:\n"
                                       "  cles bench\n"
                                       "  cles bench --transport unix\n"
                                       "  cles bench --in-flight 64 --style callback -o json\n"
                                       "  cles bench --busy-poll 50\n"
                                       "  cles bench --wake-within 0\n"
                                       "  cles bench --stress\n"
                                       "  cles bench --urgent\n"
                                       "  cles bench --against tcp://10.0.0.2\n"
                                       "  cles bench --updates --binders 8\n"
                                       "  cles bench --fan-out --binders 1,64\n"
                                       "  cles bench --bytes\n"
                                       "  cles bench --parse -o json\n";

constexpr std::size_t max_in_flight = 4096;
constexpr std::size_t max_binders = 1024;
constexpr int max_wait_us = 1'000'000;

const std::map<std::string, carrier> carriers{{"tcp", carrier::tcp},
                                              {"udp", carrier::udp},
                                              {"unix", carrier::unix_socket},
                                              {"inproc", carrier::inproc},
                                              {"multicast", carrier::multicast}};

std::vector<std::string> carrier_names() {
    std::vector<std::string> names;
    names.reserve(carriers.size());
    for (const auto& each : carriers) {
        names.push_back(each.first);
    }
    return names;
}

/// A flag that selects another measurement than that of PULLs, and what it excludes.
struct mode {
    const char* flag;
    const char* help;
    measurement what;
    std::vector<const char*> refused;
    std::vector<carrier> carried_by;
    const char* carried_why; ///< why not by others
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

measurement selected_mode(const CLI::App& command, carrier transport) {
    const auto selected =
        std::find_if(modes.begin(), modes.end(), [&](const mode& each) { return is_given(command, each.flag); });
    if (selected == modes.end()) {
        for (const char* option : {"--binders", "--keep"}) {
            if (is_given(command, option)) {
                refuse(option, "is for --updates and --fan-out");
            }
        }
        if (transport == carrier::multicast) {
            refuse("--transport multicast", "is for --fan-out");
        }
        return measurement::pulls;
    }
    const std::string not_for = std::string{"is not for "} + selected->flag;
    for (const auto& other : modes) {
        if (&other != &*selected && is_given(command, other.flag)) {
            refuse(other.flag, not_for);
        }
    }
    for (const char* option : selected->refused) {
        if (is_given(command, option)) {
            refuse(option, not_for);
        }
    }
    const auto& accepted = selected->carried_by;
    if (std::find(accepted.begin(), accepted.end(), transport) == accepted.end()) {
        refuse(selected->flag, selected->carried_why);
    }
    return selected->what;
}

} // namespace

void add_bench_arguments(CLI::App& command, bench_arguments& given) {
    command.description(bench_description);
    command.footer(bench_examples);
    command
        .add_option("--transport", given.transport,
                    "What carries the CLES exchange: tcp, udp, unix or inproc; with --fan-out tcp, unix or multicast")
        ->check(CLI::IsMember(carrier_names()).description(""))
        ->type_name("NAME");
    command.add_option("--in-flight", given.in_flight, "PULLs in flight at once on one link (1)")
        ->check(CLI::Range(std::size_t{1}, max_in_flight).description(""))
        ->type_name("N");
    command.add_option("--against", given.against, "A node that runs already and offers localization")
        ->type_name("URL");
    auto* requests =
        command.add_option("--requests", given.requests,
                           "Requests, or with --updates and --fan-out updates, in each pass (50000; "
                           "1000000 where many are in flight or published; the baseline at most 50000 "
                           "then; with --fan-out 1000 paced; with --bytes 2000; with --parse 8 MiB of them)");
    requests->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}).description(""))->type_name("N");
    command.add_option("--duration", given.duration, "How long each pass takes, instead of --requests")
        ->excludes(requests)
        ->type_name("TIME");
    command.add_option("--rounds", given.rounds, "Passes of each exchange, of which the medians are taken (5)")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000}).description(""))
        ->type_name("N");
    command.add_option("--style", given.style, "How results reach the caller's code: coroutine or callback")
        ->check(CLI::IsMember({"callback", "coroutine"}).description(""))
        ->type_name("NAME");
    command
        .add_option("--busy-poll", given.busy_poll_us,
                    "Let both ends of CLES look for work so long before they sleep, in microseconds (0)")
        ->check(CLI::Range(0, max_wait_us).description(""))
        ->type_name("US");
    command
        .add_option("--wake-within", given.wake_within_us,
                    "Let this host's cores, in all that is measured, sleep no deeper than they wake from in so many "
                    "microseconds; 0: not at all (it takes /dev/cpu_dma_latency)")
        ->check(CLI::Range(0, max_wait_us).description(""))
        ->type_name("US");
    command.add_flag("--one-core", given.one_core, "Put both ends on one core");
    for (const auto& each : modes) {
        command.add_flag(each.flag, each.help);
    }
    command
        .add_option("--binders", given.binders,
                    "Bindings, each on a link of its own (1); with --fan-out several numbers (1,8,64)")
        ->delimiter(',')
        ->check(CLI::Range(std::size_t{1}, max_binders).description(""))
        ->type_name("N");
    command.add_option("--keep", given.keep, "Updates that the publisher queues for each binder (64)")
        ->check(CLI::Range(std::uint32_t{1}, std::uint32_t{65536}).description(""))
        ->type_name("N");
    command.add_option("-o,--output", given.form, "table or json (table)")
        ->check(CLI::IsMember({"table", "json"}).description(""))
        ->type_name("FORM");
}

measurement selected_measurement(const CLI::App& command, const bench_arguments& given) {
    const auto transport = carrier_of(given.transport);
    const auto what = selected_mode(command, transport);
    if (transport == carrier::multicast && given.keep != 0) {
        refuse("--keep", "has no effect by multicast");
    }
    if (what == measurement::updates && given.binders.size() > 1) {
        refuse("--updates", "takes one number of --binders");
    }
    if (!given.against.empty() && is_given(command, "--transport")) {
        refuse("--transport", "is told by the URL of --against");
    }
    return what;
}

carrier carrier_of(const std::string& name) { return carriers.at(name); }

} // namespace tool
