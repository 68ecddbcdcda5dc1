// SPDX-License-Identifier: BSL-1.0
#include "arguments.hpp"

#include "options/duration.hpp"
#include "output/errors.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <map>

namespace tool {
namespace {

constexpr const char* bench_description =
    "Compare PULL of a localization packet with a hand-written exchange of packed structs over blocking\n"
    "TCP sockets. Both alternate in one run, each with its server in a separate process on another core.\n"
    "Other options measure BIND and UPDATE (--updates, --fan-out), PULL on loaded cores (--stress) or\n"
    "while large replies are in flight (--urgent), the bytes of each verb (--bytes), or the cost of a\n"
    "message by its length (--parse).";

constexpr const char* bench_examples = "Examples:\n"
                                       "  cles bench\n"
                                       "  cles bench --transport unix\n"
                                       "  cles bench --in-flight 64 --style callback -o json\n"
                                       "  cles bench --busy-poll 50us\n"
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
     "Measure the tail of PULL's latency while other processes use all cores, with and without real-time scheduling",
     measurement::stress,
     {"--against", "--binders", "--keep"},
     {carrier::tcp, carrier::udp, carrier::unix_socket},
     "measures between processes: --transport tcp, udp or unix"},
    {"--urgent",
     "Measure PULL while large replies of the same node are in flight, with and without urgent requests",
     measurement::urgent,
     {"--against", "--binders", "--keep"},
     {carrier::tcp, carrier::unix_socket},
     "needs a stream, because the replies are large: --transport tcp or unix"},
    {"--fan-out",
     "Measure the one-way time of an UPDATE to many subscribers, paced and as fast as possible, against the "
     "hand-written exchange",
     measurement::fan_out,
     {"--in-flight", "--against", "--duration"},
     {carrier::tcp, carrier::unix_socket, carrier::multicast},
     "has a baseline for --transport tcp, unix and multicast only"},
    {"--updates",
     "Measure UPDATE to subscribers that miss no update, instead of PULL",
     measurement::updates,
     {"--in-flight", "--against", "--duration"},
     {carrier::tcp, carrier::unix_socket},
     "measures between processes, without losses: --transport tcp or unix"},
    {"--bytes",
     "Count the bytes that each verb sends over TCP and UDP, against the packed struct",
     measurement::bytes,
     {"--transport", "--in-flight", "--against", "--duration", "--rounds", "--style", "--busy-poll", "--wake-within",
      "--one-core", "--binders", "--keep"},
     {carrier::tcp},
     ""},
    {"--parse",
     "Measure the cost of requests and replies of 64 bytes to 1 MiB, without sockets, against the packed struct",
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
                refuse(option, "needs --updates or --fan-out");
            }
        }
        if (transport == carrier::multicast) {
            refuse("--transport multicast", "needs --fan-out");
        }
        return measurement::pulls;
    }
    const std::string not_for = std::string{"cannot be combined with "} + selected->flag;
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
        .add_option(
            "--transport", given.transport,
            "The transport of the CLES exchange: tcp, udp, unix or inproc; with --fan-out tcp, unix or multicast")
        ->check(CLI::IsMember(carrier_names()).description(""))
        ->type_name("NAME");
    command.add_option("--in-flight", given.in_flight, "PULLs in flight on one link (1)")
        ->check(CLI::Range(std::size_t{1}, max_in_flight).description(""))
        ->type_name("N");
    command.add_option("--against", given.against, "The node to measure; it must be running and offer localization")
        ->type_name("URL");
    given.keys.add_optional_to(command, "With --against tls://...: the key directory of a member of the node's fleet");
    auto* requests =
        command.add_option("--requests", given.requests,
                           "Requests or updates in each pass (50000; 1000000 with --updates, or if several are in "
                           "flight: then at most 50000 of the baseline; with --fan-out 1000 paced; with --bytes "
                           "2000; with --parse as many as fill 8 MiB)");
    requests->check(CLI::Range(std::uint64_t{1}, std::uint64_t{100'000'000}).description(""))->type_name("N");
    command.add_option("--duration", given.duration, "Duration of each pass, instead of --requests")
        ->excludes(requests)
        ->type_name("TIME");
    command.add_option("--rounds", given.rounds, "Passes of each exchange; figures are medians over them (5)")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000}).description(""))
        ->type_name("N");
    command
        .add_option("--style", given.style,
                    "How results reach the caller's code: coroutine, callback, or with --updates and --fan-out batch")
        ->check(CLI::IsMember({"batch", "callback", "coroutine"}).description(""))
        ->type_name("NAME");
    command
        .add_option_function<std::string>(
            "--busy-poll", [&given](const std::string& text) { given.busy_poll = parse_wait("--busy-poll", text); },
            "How long both ends of CLES poll for work before they sleep: 50us, 1ms, or microseconds (0)")
        ->type_name("TIME");
    command
        .add_option_function<std::string>(
            "--wake-within",
            [&given](const std::string& text) { given.wake_within = parse_wait("--wake-within", text); },
            "Limit the wake-up latency of this host's cores to this time, in all measurements: 50us, or microseconds; "
            "0: they do not sleep (needs /dev/cpu_dma_latency)")
        ->type_name("TIME");
    command.add_flag("--one-core", given.one_core, "Put both ends on one core");
    for (const auto& each : modes) {
        command.add_flag(each.flag, each.help);
    }
    command
        .add_option("--binders", given.binders,
                    "Subscribers, each with a separate link (1); with --fan-out several numbers (1,8,64)")
        ->delimiter(',')
        ->check(CLI::Range(std::size_t{1}, max_binders).description(""))
        ->type_name("N");
    command.add_option("--keep", given.keep, "Updates that the publisher queues for each subscriber (64)")
        ->check(CLI::Range(std::uint32_t{1}, std::uint32_t{65536}).description(""))
        ->type_name("N");
    command.add_option("-o,--output", given.form, "table, json or raw (table)")
        ->check(CLI::IsMember({"table", "json", "raw", "text"}).description("")) // as the other commands of `cles`
        ->type_name("FORMAT");
}

measurement selected_measurement(const CLI::App& command, const bench_arguments& given) {
    const auto transport = carrier_of(given.transport);
    const auto what = selected_mode(command, transport);
    if (transport == carrier::multicast && given.keep != 0) {
        refuse("--keep", "has no effect with multicast");
    }
    if (given.style == "batch" && what != measurement::updates && what != measurement::fan_out) {
        refuse("--style", "batch needs --updates or --fan-out");
    }
    if (what == measurement::updates && given.binders.size() > 1) {
        refuse("--updates", "accepts only one value of --binders");
    }
    if (!given.against.empty() && is_given(command, "--transport")) {
        refuse("--transport", "cannot be combined with --against, whose URL contains the transport");
    }
    const bool is_secured = given.against.starts_with("tls://");
    if (is_given(command, "--keys") && !is_secured) {
        refuse("--keys", "needs --against with the URL of a node with security, as in tls://10.0.0.2");
    }
    if (is_secured && given.keys.given_directory().empty()) {
        refuse("--against", given.against + " " + keys_needed);
    }
    return what;
}

carrier carrier_of(const std::string& name) { return carriers.at(name); }

} // namespace tool
