// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "drive.hpp"
#include "simulate_command.hpp"
#include "vehicle_node.hpp"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>

#include <unistd.h>

namespace {

/// What all commands understand.
struct wishes {
    std::size_t vehicles = 0;
    double hz = 25, seconds = 0, loss_percent = 0, delay_ms = 0;
    std::uint64_t seed = 1;
    unsigned seeds = 1;
    std::string controller = "leader", group{}, record{}, vanish{};
    std::vector<std::string> vanishes{}, joins{}, leaves{};
    bool json = false, view = false, lead = false, join = false, report = false, insecure = false;
    std::string name{}, ahead{};
    double x = 0;
    std::size_t turn = 0, turns = 1;
    std::int64_t start_ns = 0;

    [[nodiscard]] platoon::driver_setup like() const {
        platoon::driver_setup setup{.hz = hz, .uses_leader = controller == "leader"};
        return setup;
    }
    [[nodiscard]] cles::multicast_options where() const {
        const char* wanted = std::getenv("CLES_MULTICAST");
        const bool in_environment = wanted != nullptr && *wanted != '\0';
        auto options = cles::parse_multicast(!group.empty() ? group : in_environment ? wanted : "lo");
        if (!options.is_on()) {
            throw cles::error(cles::errc::no_target, "vehicles hear each other by multicast, and it is off");
        }
        return options;
    }
};

struct usage_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

platoon::incident incident_of(platoon::incident::kind what, const std::string& text, std::size_t vehicles) {
    platoon::incident out{.what = what};
    char* end = nullptr;
    out.vehicle = std::strtoul(text.c_str(), &end, 10);
    const bool numbered = end != text.c_str() && *end == '@';
    const char* const at = end + (numbered ? 1 : 0);
    out.at = numbered ? std::strtod(at, &end) : -1;
    if (!numbered || end == at || *end != '\0' || !(out.at >= 0 && out.at <= 3600)) {
        throw usage_error("'" + text + "': a vehicle's number and a time are meant, as in 3@12.5");
    }
    if (out.vehicle >= vehicles) {
        throw usage_error("'" + text + "': there are vehicles 0 to " + std::to_string(vehicles - 1));
    }
    if (out.vehicle == 0 && what == platoon::incident::join) {
        throw usage_error("'" + text + "': vehicle 0 leads, and cannot join");
    }
    return out;
}

int simulate(const wishes& wanted) {
    platoon::scenario what{.vehicles = wanted.vehicles != 0 ? wanted.vehicles : 20,
                           .seconds = wanted.seconds,
                           .loss = wanted.loss_percent / 100,
                           .delay = wanted.delay_ms / 1000,
                           .like = wanted.like()};
    if (!wanted.vanish.empty()) {
        const auto which = incident_of(platoon::incident::vanish, wanted.vanish, what.vehicles);
        what.vanish = static_cast<std::ptrdiff_t>(which.vehicle);
        what.vanish_at = which.at;
    }
    return simulate_command(what, wanted.seeds, wanted.json, wanted.record);
}

int run(const wishes& wanted) {
    platoon::drive_options options{.vehicles = wanted.vehicles != 0 ? wanted.vehicles : 10,
                                   .seconds = wanted.seconds,
                                   .loss = wanted.loss_percent / 100,
                                   .delay = wanted.delay_ms / 1000,
                                   .seed = wanted.seed,
                                   .like = wanted.like(),
                                   .group = wanted.where(),
                                   .insecure = wanted.insecure,
                                   .quiet = wanted.json,
                                   .in_place = !wanted.json && (wanted.view || ::isatty(STDOUT_FILENO) == 1)};
    const auto add = [&](platoon::incident::kind what, const std::vector<std::string>& texts) {
        for (const auto& text : texts) {
            options.incidents.push_back(incident_of(what, text, options.vehicles));
        }
    };
    add(platoon::incident::vanish, wanted.vanishes);
    add(platoon::incident::join, wanted.joins);
    add(platoon::incident::leave, wanted.leaves);
    if (!wanted.record.empty()) {
        platoon::check_writable(wanted.record); // rather than after a drive of minutes
    }
    const auto drive = platoon::drive(options);
    std::puts(wanted.json ? cles::to_json(drive).c_str() : summary_of(drive).c_str());
    std::fflush(stdout);
    if (!wanted.record.empty()) {
        write(drive, wanted.record);
    }
    return drive.verdict.collision ? 1 : 0;
}

int vehicle(const wishes& wanted) {
    platoon::vehicle_options options{.setup = wanted.like(),
                                     .joins = !wanted.lead && wanted.ahead.empty(),
                                     .turn = wanted.turn,
                                     .turns = wanted.turns,
                                     .start_ns = wanted.start_ns,
                                     .seconds = wanted.seconds,
                                     .loss = wanted.loss_percent / 100,
                                     .delay = wanted.delay_ms / 1000,
                                     .seed = wanted.seed,
                                     .group = wanted.where(),
                                     .insecure = wanted.insecure};
    options.setup.name = wanted.name;
    options.setup.ahead = wanted.ahead;
    options.setup.start = {wanted.x, options.setup.plan.speed, 0};
    if (options.start_ns == 0) {
        options.start_ns = platoon::monotonic_ns();
    }
    const auto report = platoon::vehicle_node{std::move(options)}.run();
    if (wanted.report) {
        std::puts(cles::to_json(report).c_str());
    }
    return 0;
}

void add_common(CLI::App& command, wishes& wanted) {
    command.add_option("--hz", wanted.hz, "Updates of each vehicle in a second (25)")->check(CLI::Range(10.0, 50.0));
    command.add_option("--seconds", wanted.seconds, "How long; as long as the leader's manoeuvre takes unless said")
        ->check(CLI::Range(1.0, 600.0));
    command.add_option("--loss", wanted.loss_percent, "Updates that each receiver loses, in percent (0)")
        ->check(CLI::Range(0.0, 100.0));
    command.add_option("--delay", wanted.delay_ms, "How late updates are, in ms: half of it to all of it (0)")
        ->check(CLI::Range(0.0, 1000.0));
    command.add_option("--controller", wanted.controller, "Who counts: the leader too, or the predecessor alone")
        ->check(CLI::IsMember({"leader", "predecessor"}));
}

void add_group(CLI::App& command, wishes& wanted) {
    command.add_option("-m,--multicast", wanted.group, "Where they hear each other (CLES_MULTICAST, or else lo)")
        ->type_name("IFACE[,IFACE...][,GROUP[:PORT]]|auto");
    command.add_flag("--insecure", wanted.insecure, "On an interface beyond this host, where nobody proves who he is");
}

int dispatch(const CLI::App& app, const wishes& wanted) {
    if (app.got_subcommand("simulate")) {
        return simulate(wanted);
    }
    return app.got_subcommand("run") ? run(wanted) : vehicle(wanted);
}

} // namespace

int main(int argc, char** argv) {
    wishes wanted;
    CLI::App app{"A platoon of vehicles that hear each other by multicast.", "cles-platoon"};
    app.require_subcommand(1);
    app.footer("Exit codes: 0 ok, 1 a collision, 2 usage, 3 something is missing, 5 another error, 6 busy.");
    auto& in_time = *app.add_subcommand("simulate", "Drive in virtual time, without a network");
    auto& on_road = *app.add_subcommand("run", "Drive, each vehicle being a process of its own");
    auto& one = *app.add_subcommand("vehicle", "Be one vehicle: lead, follow, or join the platoon that is heard");
    for (auto* command : {&in_time, &on_road, &one}) {
        add_common(*command, wanted);
    }
    in_time.add_option("-n,--vehicles", wanted.vehicles, "How many (20)")->check(CLI::Range(2, 100));
    in_time.add_option("--seeds", wanted.seeds, "How many drives, each with losses of its own (1)")
        ->check(CLI::Range(1, 1000));
    in_time.add_option("--vanish", wanted.vanish, "Vehicle I falls silent at T")->type_name("I@T");
    on_road.add_option("-n,--vehicles", wanted.vehicles, "How many (10)")->check(CLI::Range(2, 50));
    on_road.add_option("--seed", wanted.seed, "Of the losses (1)");
    on_road.add_option("--vanish", wanted.vanishes, "Vehicle I's process is killed at T")->type_name("I@T");
    on_road.add_option("--join", wanted.joins, "Vehicle I joins at T, at the end")->type_name("I@T");
    on_road.add_option("--leave", wanted.leaves, "Vehicle I leaves at T")->type_name("I@T");
    on_road.add_flag("--view", wanted.view, "Show a table that changes in place, even if this is no terminal");
    for (auto* command : {&in_time, &on_road}) {
        command->add_option("--record", wanted.record, "Write all there is to know, for plots")->type_name("FILE");
        command->add_flag("--json", wanted.json, "Print an object, and nothing on the way");
    }
    add_group(on_road, wanted);
    add_group(one, wanted);
    one.add_option("--name", wanted.name, "Its name")->required();
    auto* const lead = one.add_flag("--lead", wanted.lead, "It leads");
    auto* const ahead = one.add_option("--ahead", wanted.ahead, "Whom it follows")->excludes(lead);
    one.add_flag("--join", wanted.join, "Joins the platoon that is heard, as it does where neither is said")
        ->excludes(lead)
        ->excludes(ahead);
    one.add_option("--x", wanted.x, "Where it is at the start, m");
    one.add_option("--turn", wanted.turn, "Which part of a period it sends in ...");
    one.add_option("--turns", wanted.turns, "... of so many")->check(CLI::Range(1, 1000));
    one.add_option("--start-ns", wanted.start_ns, "The start, by CLOCK_MONOTONIC; now unless said");
    one.add_option("--seed", wanted.seed, "Of the losses (1)");
    one.add_flag("--report", wanted.report, "Print at the end what its recorder holds");
    try {
        app.parse(argc, argv);
        return dispatch(app, wanted);
    } catch (const CLI::ParseError& wrong) { // or --help
        return app.exit(wrong) == 0 ? 0 : 2;
    } catch (const usage_error& wrong) {
        std::fprintf(stderr, "cles-platoon: %s\n", wrong.what());
        return 2;
    } catch (const cles::error& e) {
        const bool exposed = e.code() == cles::errc::insecure_listen;
        std::fprintf(stderr, "cles-platoon: %s%s\n", e.message().c_str(), exposed ? " (--insecure)" : "");
        return e.code() == cles::errc::no_target ? 3 : e.code() == cles::errc::busy ? 6 : 5;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles-platoon: %s\n", e.what());
        return 5;
    }
}
