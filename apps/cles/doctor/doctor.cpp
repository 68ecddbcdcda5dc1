// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/json_writer.hpp>

#include "client/client.hpp"
#include "commands.hpp"
#include "discovery/host.hpp"
#include "doctor/checks.hpp"
#include "output/errors.hpp"
#include "output/printer.hpp"
#include "output/terminal.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace tool {

namespace asio = boost::asio;

namespace {

struct doctor_arguments {
    address_book addresses;
    output_format format = output_format::automatic;
};

std::size_t count(const findings& found, verdict how) {
    return static_cast<std::size_t>(
        std::count_if(found.all().begin(), found.all().end(), [&](const finding& each) { return each.how == how; }));
}

std::string_view verdict_text(verdict how) {
    switch (how) {
    case verdict::ok: return "ok";
    case verdict::warning: return "warning";
    case verdict::failure: return "failure";
    }
    return "";
}

std::string styled(verdict how, const std::string& text) {
    switch (how) {
    case verdict::ok: return text;
    case verdict::warning: return bold(stream::out, text);
    case verdict::failure: return red(stream::out, text);
    }
    return text;
}

std::string findings_text(const findings& found) {
    constexpr std::size_t verdict_width = 9;
    constexpr std::size_t check_width = 12;
    std::string out;
    for (const auto& each : found.all()) {
        out += styled(each.how, padded(std::string{verdict_text(each.how)}, verdict_width));
        out += padded(std::string{each.check}, check_width) + printable(each.text) + "\n";
        if (!each.advice.empty()) {
            out += std::string(verdict_width + check_width, ' ') + "-> " + printable(each.advice) + "\n";
        }
    }
    return out;
}

std::string findings_json(const findings& found) {
    std::string out;
    cles::json_writer w{out};
    w.begin_object();
    w.key("failures");
    w.value(count(found, verdict::failure));
    w.key("warnings");
    w.value(count(found, verdict::warning));
    w.key("findings");
    w.begin_array();
    for (const auto& each : found.all()) {
        w.begin_object();
        w.key("check");
        w.value(each.check);
        w.key("verdict");
        w.value(verdict_text(each.how));
        w.key("text");
        w.value(std::string_view{each.text});
        if (!each.advice.empty()) {
            w.key("advice");
            w.value(std::string_view{each.advice});
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

asio::awaitable<void> check_network(client& requester, const address_book& addresses, known_before& known,
                                    findings& found) {
    auto at_port = co_await check_ports(requester, addresses, found);
    known.at_port = std::move(at_port);
    co_await check_nodes(requester, addresses, known, found);
}

int run_checks(doctor_arguments& args, int verbosity) {
    args.addresses.check();
    findings found;
    check_configuration(found);
    const auto key = check_keys(args.addresses.keys(), found);
    const auto group = args.addresses.group();
    check_interfaces(group, args.addresses.is_secured(), found);
    if (const auto usable = check_multicast(group, found); usable != cles::interfaces_of(group) || usable.empty()) {
        args.addresses.restrict_group_to(usable); // so that the remaining checks work
    }
    if (key.is_usable) {
        try {
            known_before known{.nobody_listens = group.is_on() && has_no_listener(args.addresses.group()),
                               .may_ask_group = key.may_ask_group};
            client requester{args.addresses, verbosity};
            const auto code = requester.run(check_network(requester, args.addresses, known, found));
            if (code != exit_code::success) {
                return code; // interrupted
            }
        } catch (const cles::error& e) { // of this host, of which other checks have told
            found.failure("nodes", "no node can be asked: " + e.message(), "correct what else is reported here");
        }
    }
    check_clock(found);
    check_limits(found);
    if (resolved(args.format) == output_format::table) {
        write_output(findings_text(found));
    } else {
        printer{args.format, false}.print(findings_json(found));
    }
    return count(found, verdict::failure) != 0 ? exit_code::local_failure : exit_code::success;
}

} // namespace

void add_doctor(CLI::App& app, context& shared) {
    auto args = std::make_shared<doctor_arguments>();
    auto* command = app.add_subcommand("doctor", "Find out why nodes do not work together");
    args->addresses.add_options(*command);
    add_output_option(*command, args->format);
    command->footer("Checks the configuration of clesd, the key directory, interfaces, multicast, ports, nodes, the "
                    "connections of bridges\n"
                    "to NATS, the clock and limits, and reports what is wrong and how to correct it. The exit code is "
                    "1 if a check fails.\n\n"
                    "Examples:\n"
                    "  cles doctor\n"
                    "  cles doctor -m eth0\n"
                    "  cles doctor --keys /var/lib/cles/keys\n"
                    "  cles doctor --at tcp://10.0.0.7 -o json | jq -r '.findings[] | select(.verdict != \"ok\")'");
    command->callback([args, &shared] { shared.exit_code = run_checks(*args, shared.verbosity); });
}

} // namespace tool
