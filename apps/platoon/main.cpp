// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/error.hpp>

#include "client/member_key.hpp"
#include "options/keys_option.hpp"
#include "output/end_of_output.hpp"
#include "output/errors.hpp"
#include "platoon/drive/drive.hpp"
#include "platoon/drive/relay.hpp"
#include "platoon/drive/vehicle_node.hpp"
#include "platoon/drive/watch.hpp"
#include "platoon/simulate_command.hpp"
#include "platoon/simulation/outcome.hpp"

#include <boost/describe/enum_from_string.hpp>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>

#include <unistd.h>

namespace {

/// The arguments of all commands.
struct arguments {
    std::size_t vehicles = 0;
    double hz = 25, seconds = 0, loss_percent = 0, burst = 0, delay_ms = 0;
    std::vector<double> lags{}, brakes{};
    platoon::manoeuvre plan{};
    double lag = platoon::vehicle_limits{}.lag, brake = platoon::vehicle_limits{}.brake, length = platoon::usual_length;
    std::uint64_t seed = 1, first_seed = 1;
    unsigned seeds = 1;
    std::string controller = "leader", group{}, record{};
    std::vector<std::size_t> minimum{}, older{};
    bool leader_unknown = false;
    std::string dialect = "current";
    std::vector<std::string> vanishes{}, mutes{}, joins{}, leaves{}, merges{}, splits{};
    bool json = false, view = false, lead = false, join = false, report = false, insecure = false, secured = false,
         no_radar = false;
    tool::keys_option keys{}; // of a vehicle
    std::string fleet{};
    std::string name{}, ahead{}, behind{}, leader{};
    double x = 0;
    std::size_t turn = 0, turns = 1;
    std::int64_t start_ns = 0;
    double start_utc = 0;
    std::string exchange{}, listen{};
    std::vector<int> devices{};

    [[nodiscard]] platoon::driver_setup setup() const {
        return {.hz = hz,
                .uses_leader = controller == "leader",
                .plan = plan,
                .radar = {.fitted = !no_radar},
                .law = platoon::gains_for(hz)};
    }
    [[nodiscard]] platoon::gilbert_elliott losses() const {
        const double loss = loss_percent / 100;
        if (burst > 0 && (loss >= 1 || burst < platoon::gilbert_elliott::shortest(loss))) {
            throw tool::usage_error("--burst: at this loss, bursts have at least loss / (1 - loss) updates on average");
        }
        return platoon::losses_of(loss, burst);
    }
    [[nodiscard]] platoon::spread differences() const {
        platoon::spread out;
        if (!lags.empty()) {
            out.least_lag = lags.front();
            out.most_lag = lags.back();
        }
        if (!brakes.empty()) {
            out.least_brake = brakes.front();
            out.most_brake = brakes.back();
        }
        if (out.least_lag > out.most_lag || out.least_brake > out.most_brake) {
            throw tool::usage_error("--lags and --brakes: write the lower limit first");
        }
        return out;
    }
    [[nodiscard]] bool in_place() const { return !json && (view || ::isatty(STDOUT_FILENO) == 1); }
    [[nodiscard]] std::vector<platoon::incident> incidents(std::size_t all_vehicles) const;
    [[nodiscard]] cles::multicast_options group_options() const {
        const char* variable = std::getenv("CLES_MULTICAST");
        const bool in_environment = variable != nullptr && *variable != '\0';
        auto options = cles::parse_multicast(!group.empty() ? group : in_environment ? variable : "lo");
        if (!options.is_on()) {
            throw cles::error(cles::errc::no_target, "vehicles communicate by multicast, which is off");
        }
        return options;
    }
};

using platoon::simulate_command;
using platoon::tune_command;
using tool::usage_error;

platoon::incident incident_of(platoon::incident::kind what, const std::string& text, std::size_t vehicles) {
    platoon::incident out{.what = what};
    char* end = nullptr;
    out.vehicle = std::strtoul(text.c_str(), &end, 10);
    const bool numbered = end != text.c_str() && *end == '@';
    const char* const at = end + (numbered ? 1 : 0);
    out.at = numbered ? std::strtod(at, &end) : -1;
    bool valid = numbered && end != at && out.at >= 0 && out.at <= 3600;
    if (valid && what == platoon::incident::mute && *end == '+') {
        const char* const lasts = end + 1;
        out.lasts = std::strtod(lasts, &end);
        valid = end != lasts && out.lasts > 0;
    }
    if (!valid || *end != '\0') {
        throw usage_error("'" + text + "': write the number of a vehicle and a time, as in 3@12.5");
    }
    if (out.vehicle >= vehicles) {
        throw usage_error("'" + text + "': the vehicles are 0 to " + std::to_string(vehicles - 1));
    }
    if (out.vehicle == 0 && (what == platoon::incident::join || what == platoon::incident::split)) {
        throw usage_error("'" + text + "': vehicle 0 leads, and can neither join nor split off");
    }
    return out;
}

std::vector<platoon::incident> arguments::incidents(std::size_t all_vehicles) const {
    std::vector<platoon::incident> all;
    const auto add = [&](platoon::incident::kind what, const std::vector<std::string>& texts) {
        for (const auto& text : texts) {
            all.push_back(incident_of(what, text, all_vehicles));
        }
    };
    add(platoon::incident::mute, mutes);
    add(platoon::incident::vanish, vanishes);
    add(platoon::incident::join, joins);
    add(platoon::incident::merge, merges);
    add(platoon::incident::split, splits);
    add(platoon::incident::leave, leaves);
    if (no_radar && !splits.empty()) {
        throw tool::usage_error("--split: vehicles that split off keep their distance by radar");
    }
    return all;
}

platoon::scenario scenario_of(const arguments& args) {
    const std::size_t vehicles = args.vehicles != 0 ? args.vehicles : 20;
    std::vector<platoon::dialect> dialects(vehicles);
    const auto set = [&](const char* option, const std::vector<std::size_t>& which, platoon::dialect how) {
        for (const auto each : which) {
            if (each >= vehicles) {
                throw usage_error(std::string{option} + ": the vehicles are 0 to " + std::to_string(vehicles - 1));
            }
            dialects[each] = how;
        }
    };
    set("--older", args.older, platoon::dialect::older);
    set("--minimum", args.minimum, platoon::dialect::minimum);
    return {.vehicles = vehicles,
            .seconds = args.seconds,
            .losses = args.losses(),
            .delay = args.delay_ms / 1000,
            .seed = args.first_seed,
            .incidents = args.incidents(vehicles),
            .differences = args.differences(),
            .setup = args.setup(),
            .dialects = std::move(dialects),
            .leader_known = !args.leader_unknown};
}

// Before a drive of minutes.
void check_record(const arguments& args) {
    if (!args.record.empty()) {
        platoon::check_writable(args.record);
    }
}

/// \return the exit code
int tell(const platoon::recording& drive, const arguments& args) {
    std::puts(args.json ? cles::to_json(drive).c_str() : summary_of(drive).c_str());
    std::fflush(stdout);
    if (!args.record.empty()) {
        write(drive, args.record);
    }
    return exit_code_of(drive.verdict, drive.steady);
}

int run(const arguments& args) {
    const std::size_t vehicles = args.vehicles != 0 ? args.vehicles : 10;
    const auto losses = args.losses(); // checks them
    platoon::drive_options options{.vehicles = vehicles,
                                   .seconds = args.seconds,
                                   .loss = losses.mean_loss(),
                                   .delay = args.delay_ms / 1000,
                                   .burst = args.burst,
                                   .differences = args.differences(),
                                   .seed = args.seed,
                                   .setup = args.setup(),
                                   .incidents = args.incidents(vehicles),
                                   .group = args.group_options(),
                                   .insecure = args.insecure,
                                   .keys = args.fleet,
                                   .secured = args.secured,
                                   .quiet = args.json,
                                   .in_place = args.in_place()};
    check_record(args);
    ::unsetenv("CLES_KEYS"); // it would be the key of every vehicle
    return tell(platoon::drive(options), args);
}

int watch(const arguments& args) {
    const platoon::watch_options options{.seconds = args.seconds,
                                         .setup = args.setup(),
                                         .group = args.group_options(),
                                         .insecure = args.insecure,
                                         .keys = args.keys.given_directory(),
                                         .quiet = args.json,
                                         .in_place = args.in_place()};
    check_record(args);
    return tell(platoon::watch(options), args);
}

int vehicle(const arguments& args) {
    platoon::vehicle_options options{.setup = {.driving = args.setup(),
                                               .turn = args.turn,
                                               .turns = args.turns,
                                               .start_utc = args.start_utc,
                                               .seed = args.seed,
                                               .separate_truth = !args.exchange.empty()},
                                     .joins = !args.lead && args.ahead.empty(),
                                     .behind = args.behind,
                                     .start_ns = args.start_ns,
                                     .seconds = args.seconds,
                                     .group = args.group_options(),
                                     .insecure = args.insecure,
                                     .keys = args.keys.given_directory(),
                                     .exchange = args.exchange};
    if (args.name.empty() && options.keys.empty()) {
        throw usage_error("which vehicle is it? Give --name, or --keys with the key of a member of a fleet");
    }
    auto& driving = options.setup.driving;
    driving.name = args.name.empty() ? tool::name_of_member(options.keys) : args.name;
    driving.ahead = args.ahead;
    driving.start = {args.x, driving.plan.speed, 0};
    driving.limits.lag = args.lag;
    driving.limits.brake = args.brake;
    driving.limits.length = args.length;
    driving.leader = args.leader;
    boost::describe::enum_from_string(args.dialect.c_str(), options.setup.tells);
    if (options.start_ns == 0) {
        options.start_ns = platoon::monotonic_ns();
    }
    if (options.setup.start_utc == 0) {
        options.setup.start_utc = platoon::utc_at(options.start_ns);
    }
    const auto report = platoon::vehicle_node{std::move(options)}.run();
    if (args.report) {
        std::puts(cles::to_json(report).c_str());
    }
    return 0;
}

int relay(const arguments& args) {
    platoon::run_relay({.devices = args.devices,
                        .listen = args.listen,
                        .losses = args.losses(),
                        .delay = args.delay_ms / 1000,
                        .seed = args.seed});
    return 0;
}

void add_common(CLI::App& command, arguments& args) {
    command.add_option("--hz", args.hz, "Updates of each vehicle per second (25)")->check(CLI::Range(10.0, 50.0));
    command.add_option("--seconds", args.seconds, "Duration (default: until the leader's manoeuvre ends)")
        ->check(CLI::Range(1.0, 600.0));
    command.add_flag("--no-radar", args.no_radar, "Vehicles have no radar: without updates they see nothing");
    command.add_option("--brake-at", args.plan.brake_at, "The leader brakes at T (5)")
        ->check(CLI::Range(0.0, 3600.0))
        ->type_name("T");
    command.add_option("--slow", args.plan.slow, "It brakes from 25 m/s to this speed in m/s (10)")
        ->check(CLI::Range(1.0, 24.0));
    command.add_option("--slow-for", args.plan.slow_for, "It drives slowly for this many seconds (5)")
        ->check(CLI::Range(0.0, 600.0));
    command.add_option("--controller", args.controller, "Follow the leader too, or only the predecessor")
        ->check(CLI::IsMember({"leader", "predecessor"}));
}

void add_faults(CLI::App& command, arguments& args) {
    command.add_option("--loss", args.loss_percent, "Updates that each receiver loses, in percent (0)")
        ->check(CLI::Range(0.0, 100.0));
    command
        .add_option("--burst", args.burst,
                    "Updates are lost in bursts, with this mean number of updates (independently)")
        ->check(CLI::Range(0.0, 1000.0));
    command.add_option("--delay", args.delay_ms, "Delay of updates in ms: at least half of it, at most all of it (0)")
        ->check(CLI::Range(0.0, 1000.0));
}

void add_differences(CLI::App& command, arguments& args) {
    command.add_option("--lags", args.lags, "Engines and brakes lag by LOW to HIGH seconds (0.3)")
        ->expected(2)
        ->check(CLI::Range(0.05, 2.0));
    command.add_option("--brakes", args.brakes, "Vehicles brake with at most LOW to HIGH m/s² (8)")
        ->expected(2)
        ->check(CLI::Range(1.0, 12.0));
    command.add_option("--vanish", args.vanishes, "The process of vehicle I is killed at T")->type_name("I@T");
    command.add_option("--merge", args.merges, "A further vehicle merges behind vehicle I at T")->type_name("I@T");
    command.add_option("--split", args.splits, "Vehicle I and those behind split off at T")->type_name("I@T");
    command.add_option("--leave", args.leaves, "Vehicle I leaves at T")->type_name("I@T");
}

void add_seeds(CLI::App& command, arguments& args) {
    command.add_option("-n,--vehicles", args.vehicles, "Number of vehicles (20)")->check(CLI::Range(2, 100));
    command.add_option("--seeds", args.seeds, "Number of drives, each with its own losses (1)")
        ->check(CLI::Range(1, 100'000));
    command
        .add_option("--sine", args.plan.period,
                    "The leader's acceleration is a sine of 1 m/s² with this period in seconds, and it does not brake")
        ->check(CLI::Range(1.0, 60.0));
    command.add_option("--mute", args.mutes, "Vehicle I sends nothing from T on, for D seconds")->type_name("I@T[+D]");
    command.add_option("--first-seed", args.first_seed, "Seed of the first of them (1)");
    command.add_option("--minimum", args.minimum, "These vehicles tell only the paper's minimum")
        ->delimiter(',')
        ->type_name("I[,I...]");
    command.add_option("--older", args.older, "These vehicles tell what older ones do")
        ->delimiter(',')
        ->type_name("I[,I...]");
    command.add_flag("--leader-unknown", args.leader_unknown, "Those behind them do not know the leader");
}

void add_group(CLI::App& command, arguments& args) {
    command
        .add_option("-m,--multicast", args.group, "Interface and group to communicate by (CLES_MULTICAST, or else lo)")
        ->type_name("IFACE[,IFACE...][,GROUP[:PORT]]|auto");
    command.add_flag("--insecure", args.insecure,
                     "Allow an interface beyond this host, where nodes are not authenticated");
}

int dispatch(const CLI::App& app, const arguments& args) {
    if (app.got_subcommand("simulate")) {
        return simulate_command(scenario_of(args), args.seeds, args.json, args.record);
    }
    if (app.got_subcommand("tune")) {
        return tune_command(scenario_of(args), args.seeds);
    }
    if (app.got_subcommand("relay")) {
        return relay(args);
    }
    if (app.got_subcommand("watch")) {
        return watch(args);
    }
    return app.got_subcommand("run") ? run(args) : vehicle(args);
}

} // namespace

int main(int argc, char** argv) {
    tool::check_output_at_exit("cles-platoon", 5);
    arguments args;
    CLI::App app{"A platoon of vehicles that communicate by multicast.", "cles-platoon"};
    app.require_subcommand(1);
    app.footer(
        "Exit codes: 0 ok, 1 a collision, or a platoon that stood still or fell apart, 2 usage, 3 no vehicle, no "
        "multicast, or no network namespaces for faults, 4 the manoeuvre did not end, 5 another error, 6 busy.");
    auto& in_time =
        *app.add_subcommand("simulate", "Simulate the control law alone in virtual time: no nodes, no network");
    auto& search = *app.add_subcommand("tune", "Search the gains of the control law, in virtual time");
    auto& on_road = *app.add_subcommand("run", "Run a drive, with a process for each vehicle");
    auto& one = *app.add_subcommand("vehicle", "Run one vehicle: lead, follow, or join a platoon");
    auto& beside = *app.add_subcommand("watch", "Watch the vehicles of a group, whoever has started them");
    auto& between = *app.add_subcommand("relay", "Carry packets between the networks of vehicles")->group("");
    for (auto* command : {&in_time, &search, &on_road, &one}) {
        add_common(*command, args);
    }
    for (auto* command : {&in_time, &search, &on_road}) {
        add_differences(*command, args);
    }
    for (auto* command : {&in_time, &search, &on_road, &between}) {
        add_faults(*command, args);
    }
    between.add_option("--devices", args.devices, "The descriptor of each device")->delimiter(',');
    between.add_option("--listen", args.listen, "The URL at which it is asked");
    between.add_option("--seed", args.seed, "Seed of the losses (1)");
    for (auto* command : {&in_time, &search}) {
        add_seeds(*command, args);
    }
    on_road.add_option("-n,--vehicles", args.vehicles, "Number of vehicles (10)")->check(CLI::Range(2, 50));
    on_road.add_option("--seed", args.seed, "Seed of the losses (1)");
    on_road.add_option("--join", args.joins, "Vehicle I joins the end of the platoon at T")->type_name("I@T");
    // Not from CLES_KEYS, which names the directory of one member.
    on_road
        .add_option("-k,--keys", args.fleet, "A fleet's folder with the keys of operator, v0, v1 ...: all is sealed")
        ->type_name("DIR");
    on_road
        .add_flag("--secured", args.secured, "The same with a fleet for this drive alone, whose keys are then removed")
        ->excludes("--keys");
    for (auto* command : {&on_road, &beside}) {
        command->add_flag("--view", args.view, "Show a table that changes in place, even if stdout is not a terminal");
    }
    for (auto* command : {&in_time, &on_road, &beside}) {
        command->add_option("--record", args.record, "Write a complete record, for plots")->type_name("FILE");
        command->add_flag("--json", args.json, "Print a JSON object, and no progress");
    }
    add_group(on_road, args);
    add_group(one, args);
    add_group(beside, args);
    beside.add_option("--seconds", args.seconds, "Duration (default: until it is interrupted)")
        ->check(CLI::Range(1.0, 86400.0));
    args.keys.add_optional_to(beside, "The directory with the key of a member that may receive states");
    args.keys.add_optional_to(one, "The directory with the vehicle's key: all is sealed, and its states are signed");
    one.add_option("--name", args.name, "The name of the vehicle (default: that of its key)");
    auto* const lead = one.add_flag("--lead", args.lead, "Lead the platoon");
    auto* const ahead = one.add_option("--ahead", args.ahead, "The vehicle to follow")->excludes(lead);
    one.add_flag("--join", args.join, "Join the platoon in the group (default)")->excludes(lead)->excludes(ahead);
    one.add_option("--behind", args.behind, "Merge behind this vehicle, in the middle of the platoon")
        ->excludes(lead)
        ->excludes(ahead);
    one.add_option("--leader", args.leader, "The leader, if the vehicle ahead does not tell it")->excludes(lead);
    one.add_option("--dialect", args.dialect, "What it tells: everything, or what older vehicles do, or the minimum")
        ->check(CLI::IsMember({"current", "older", "minimum"}));
    one.add_option("--length", args.length, "The length, m (5)")->check(CLI::Range(1.0, 30.0));
    one.add_option("--lag", args.lag, "The lag of engine and brakes, s (0.3)")->check(CLI::Range(0.05, 2.0));
    one.add_option("--brake", args.brake, "The maximum deceleration, m/s² (8)")->check(CLI::Range(1.0, 12.0));
    one.add_option("--x", args.x, "Position at the start, m");
    one.add_option("--turn", args.turn, "The slot of a period in which it sends ...");
    one.add_option("--turns", args.turns, "... of this number of slots")->check(CLI::Range(1, 1000));
    one.add_option("--start-ns", args.start_ns, "The start, by CLOCK_MONOTONIC (default: now)");
    one.add_option("--start-utc", args.start_utc,
                   "The same in UTC, seconds since 1970 (default: by this host's clock)");
    one.add_option("--seed", args.seed, "Seed of its radar's errors (1)");
    one.add_option("--exchange", args.exchange, "The folder of sockets for true positions")->group("");
    one.add_flag("--report", args.report, "Print the report of its recorder at the end");
    try {
        app.parse(argc, argv);
        return dispatch(app, args);
    } catch (const CLI::ParseError& error) { // or --help
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const usage_error& error) {
        std::fprintf(stderr, "cles-platoon: %s\n", error.what());
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
