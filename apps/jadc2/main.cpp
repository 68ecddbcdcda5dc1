// SPDX-License-Identifier: BSL-1.0
#include "client/member_key.hpp"
#include "drill.hpp"
#include "fmv/frame_codec.hpp"
#include "frame_load.hpp"
#include "fusion_comparison.hpp"
#include "mission.hpp"
#include "options/keys_option.hpp"
#include "output/end_of_output.hpp"
#include "output/errors.hpp"
#include "recon.hpp"
#include "rehearsal.hpp"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace {

int report_failure(const cles::error& why) {
    const auto code = why.code();
    const bool keyless = code == cles::errc::unknown_scheme && why.message().find("'tls'") != std::string::npos;
    std::fprintf(stderr, "cles-jadc2: %s%s%s\n", why.what(), keyless ? ": it " : "", keyless ? tool::keys_needed : "");
    const bool missing = code == cles::errc::no_target || code == cles::errc::no_task;
    return missing ? 3 : code == cles::errc::deadline ? 4 : code == cles::errc::busy ? 6 : 5;
}

constexpr auto keys_help =
    "The directory with the node's key: all links are sealed, and its rights are those of its fleet";

// With keys, plain TCP is refused.
void seal_default(const CLI::App& command, const char* option, std::string& url) {
    if (command.count(option) == 0) {
        url.replace(0, url.find(':'), "tls");
    }
}

// The node has the name of its key.
void take_name(const CLI::App& command, const std::string& keys, std::string& name) {
    const auto known = tool::name_of_member(keys);
    if (command.count("--name") != 0 && name != known) {
        throw tool::usage_error("--name " + name + " is not the name of the key in " + keys + ", which is " + known);
    }
    name = known;
}

// "recon/" stands for "recon".
std::string without_slashes_at_end(std::string path) {
    while (path.size() > 1 && path.ends_with('/')) {
        path.pop_back();
    }
    return path;
}

int run_recon(const CLI::App& command, jadc2::recon_options args, const std::string& keys) {
    if (!keys.empty()) {
        args.keys = keys;
        if (args.camera_keys.empty()) {
            args.camera_keys = without_slashes_at_end(keys) + "-camera";
            if (!std::filesystem::exists(args.camera_keys)) {
                throw tool::usage_error("the node for satellites has a key of its own, which is not in " +
                                        args.camera_keys + ": name its directory with --camera-keys");
            }
        }
        take_name(command, keys, args.name);
        seal_default(command, "--listen", args.listen);
        seal_default(command, "--camera-listen", args.camera_listen.front());
        seal_default(command, "--satellite", args.satellites.front());
    } else if (!args.camera_keys.empty()) {
        throw tool::usage_error("--camera-keys: needs --keys too");
    }
    return jadc2::recon{args}.run();
}

int run_mission(const CLI::App& command, jadc2::mission_options args, const std::string& keys) {
    if (!keys.empty()) {
        args.keys = keys;
        take_name(command, keys, args.name);
        seal_default(command, "--recon", args.recon);
        seal_default(command, "--strike", args.strikers.front());
    }
    return jadc2::mission{args}.run();
}

// Of `drill` and `load`.
template <class Options>
Options sealed(const CLI::App& command, Options args, const std::string& keys) {
    args.keys = keys;
    if (!keys.empty()) {
        seal_default(command, "--at", args.at);
    }
    return args;
}

void add_format(CLI::App& command, std::string& format) {
    command.add_option("--format", format, "Of frames: jpeg (the default, if built with libjpeg-turbo) or grey")
        ->check(CLI::IsMember(fmv::has_jpeg() ? std::vector<std::string>{"grey", "jpeg"}
                                              : std::vector<std::string>{"grey"}));
}

CLI::App* add_recon(CLI::App& app, jadc2::recon_options& args) {
    auto* r =
        app.add_subcommand("recon", "The reconnaissance aircraft: films, delegates the processing, publishes tracks");
    r->add_option("--name", args.name, "Its name (recon)");
    r->add_option("-l,--listen", args.listen, "Where it listens for the mission centre (tcp://127.0.0.1:25373)")
        ->type_name("URL");
    r->add_flag("--insecure", args.insecure, "Allow listening beyond this host, where anyone may send any request");
    r->add_option("--camera-keys", args.camera_keys,
                  "With --keys: the directory with the key of the node for satellites (that of --keys, with -camera)")
        ->type_name("DIR");
    r->add_option("-s,--satellite", args.satellites, "A node that processes video (tcp://127.0.0.1:25370)")
        ->type_name("URL");
    r->add_option("--camera-listen", args.camera_listen,
                  "Where satellites get the frames; may be repeated, once for each link (tcp://127.0.0.1:25372)")
        ->type_name("URL");
    r->add_option("--seed", args.seed, "Seed of the scene; the strike aircraft's sensor has to have the same (1)")
        ->check(CLI::NonNegativeNumber);
    add_format(*r, args.format);
    r->add_option("--fps", args.fps, "Frames per second (25)")->check(CLI::Range(0.1, 200.0));
    r->add_option("--frames", args.frames, "Frames after which it ends; 0: no limit (0)")
        ->check(CLI::NonNegativeNumber);
    r->add_option("--deadline", args.deadline_ms,
                  "Milliseconds for the result of a frame, after which another node goes on (1000)")
        ->check(CLI::Range(1, 60'000));
    r->add_flag("--json", args.json, "Print a JSON object for each event");
    return r;
}

CLI::App* add_mission(CLI::App& app, jadc2::mission_options& args) {
    auto* m = app.add_subcommand("mission", "The mission centre: watches the tracks, decides, delegates strikes");
    m->add_option("--name", args.name, "Its name (mission)");
    m->add_option("--recon-name", args.recon_name, "The name of the reconnaissance aircraft (recon)");
    m->add_option("-r,--recon", args.recon, "Its address (tcp://127.0.0.1:25373)")->type_name("URL");
    m->add_option("-s,--strike", args.strikers, "A node that strikes (tcp://127.0.0.1:25374)")->type_name("URL");
    m->add_option("--strikes", args.strikes, "Strikes after which it ends (1)")->check(CLI::Range(1, 1000));
    m->add_option("--age", args.age_s, "Seconds for which a target is followed before it is struck (0.6)")
        ->check(CLI::Range(0.0, 3600.0));
    m->add_option("--oldest", args.oldest_s, "Seconds after which a picture is too old for an order (2)")
        ->check(CLI::Range(0.1, 3600.0));
    m->add_option("--every", args.every_ms, "The minimum interval between pictures of the tracks in milliseconds (250)")
        ->check(CLI::Range(0, 60'000));
    m->add_flag("--operator", args.has_operator, "Let an operator at the terminal decide; otherwise a script decides");
    m->add_option("--audit", args.audit, "A file to which all that happens is added")->type_name("FILE");
    m->add_option("--duration", args.duration_s, "Seconds after which it ends in any case; 0: no limit (0)")
        ->check(CLI::Range(0.0, 86'400.0));
    m->add_option("--deadline", args.deadline_ms, "Deadline of a strike in milliseconds (3000)")
        ->check(CLI::Range(1, 60'000));
    m->add_flag("--json", args.json, "Print a JSON object for each event");
    return m;
}

CLI::App* add_drill(CLI::App& app, jadc2::drill_options& args) {
    auto* d = app.add_subcommand("drill", "Measures how long strike orders take, without a release");
    d->add_option("--at", args.at, "A node that strikes (tcp://127.0.0.1:25374)")->type_name("URL");
    d->add_option("-n,--count", args.count, "Orders (1000)")->check(CLI::Range(1, 10'000'000));
    d->add_option("--every", args.every_us, "Microseconds between them (2000)")->check(CLI::Range(0, 10'000'000));
    return d;
}

CLI::App* add_rehearse(CLI::App& app, jadc2::rehearsal_options& args) {
    auto* r = app.add_subcommand("rehearse", "Measures how many strikes hit, in simulated time and without a network");
    r->add_option("-n,--strikes", args.strikes, "Strikes (100)")->check(CLI::Range(1, 100'000));
    r->add_option("--seed", args.seed, "Seed of the first scene (1)")->check(CLI::NonNegativeNumber);
    r->add_option("--scans", args.scans, "Scans of the strike aircraft's sensor that are fused with the track (30)")
        ->check(CLI::Range(0, 30));
    r->add_option("--delay", args.delay_s, "Seconds from the frame to the release (0.3)")->check(CLI::Range(0.0, 2.0));
    return r;
}

CLI::App* add_compare(CLI::App& app, jadc2::comparison_options& args) {
    auto* c = app.add_subcommand("compare", "Measures how much more accurate tracks are if a satellite's own plots are "
                                            "fused with the video, in simulated time and without a network");
    c->add_option("-n,--scenes", args.scenes, "Scenes (20)")->check(CLI::Range(1, 10'000));
    c->add_option("--seed", args.seed, "Seed of the first scene (1)")->check(CLI::NonNegativeNumber);
    c->add_option("--seconds", args.seconds, "Length of each film (6)")->check(CLI::Range(3.0, 600.0));
    return c;
}

CLI::App* add_load(CLI::App& app, jadc2::load_options& args) {
    auto* l = app.add_subcommand("load", "Sends frames to a node as fast as it answers");
    l->add_option("--at", args.at, "Address of the node (tcp://127.0.0.1:25370)")->type_name("URL");
    l->add_option("--streams", args.streams, "Number of parallel streams (4)")->check(CLI::Range(1, 64));
    l->add_option("--duration", args.duration_s, "Seconds; 0: until it is stopped (5)")->check(CLI::Range(0.0, 3600.0));
    l->add_option("--seed", args.seed, "Seed of the scene (1)")->check(CLI::NonNegativeNumber);
    add_format(*l, args.format);
    return l;
}

} // namespace

int main(int argc, char** argv) {
    tool::check_output_at_exit("cles-jadc2", 5);
    jadc2::recon_options recon;
    jadc2::mission_options mission;
    jadc2::drill_options drill;
    jadc2::load_options load;
    jadc2::rehearsal_options rehearsal;
    jadc2::comparison_options comparison;
    CLI::App app{"Joint command: a reconnaissance aircraft and a mission centre.", "cles-jadc2"};
    app.require_subcommand(1);
    const auto* as_recon = add_recon(app, recon);
    const auto* as_mission = add_mission(app, mission);
    const auto* as_drill = add_drill(app, drill);
    const auto* as_load = add_load(app, load);
    const auto* as_rehearse = add_rehearse(app, rehearsal);
    const auto* as_compare = add_compare(app, comparison);
    tool::keys_option keys;
    for (auto* command : app.get_subcommands({})) {
        if (command != as_rehearse && command != as_compare) {
            keys.add_optional_to(*command, keys_help);
        }
    }
    app.footer("With --keys, default addresses begin with tls:// instead of tcp://.\n\nExit codes: 0 ok, 2 usage, 3 no "
               "node or no task, 4 deadline or unknown result, 5 another error, 6 busy, 7 an order "
               "has missed.");
    try {
        app.parse(argc, argv);
        const auto directory = keys.given_directory();
        return as_recon->parsed()      ? run_recon(*as_recon, recon, directory)
               : as_mission->parsed()  ? run_mission(*as_mission, mission, directory)
               : as_rehearse->parsed() ? jadc2::print_rehearsal(rehearsal)
               : as_compare->parsed()  ? jadc2::print_comparison(comparison)
               : as_drill->parsed()    ? jadc2::drill(sealed(*as_drill, drill, directory))
                                       : jadc2::run_load(sealed(*as_load, load, directory));
    } catch (const CLI::ParseError& error) { // or --help
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const tool::usage_error& e) {
        std::fprintf(stderr, "cles-jadc2: %s\n", e.what());
        return 2;
    } catch (const cles::error& e) {
        return report_failure(e);
    } catch (const std::exception& e) { // of files with keys
        std::fprintf(stderr, "cles-jadc2: %s\n", e.what());
        return 5;
    }
}
