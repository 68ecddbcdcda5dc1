// SPDX-License-Identifier: BSL-1.0
#include "client/client.hpp"
#include "commands.hpp"
#include "context.hpp"
#include "doctor/checks.hpp"
#include "output/exit_code.hpp"
#include "output/output.hpp"
#include "output/printer.hpp"

#include <boost/asio/awaitable.hpp>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <memory>

namespace tool {

namespace asio = boost::asio;

namespace {

struct doctor_command {
    address_book addresses;
    output_format format = output_format::automatic;
};

asio::awaitable<void> ask_around(client& asker, const address_book& addresses, findings& found) {
    co_await check_ports(asker, addresses, found);
    co_await check_nodes(asker, addresses, found);
}

int examine(doctor_command& wanted, int verbosity) {
    wanted.addresses.check();
    findings found;
    check_config(found);
    check_interfaces(wanted.addresses.group(), found);
    const auto group = wanted.addresses.group();
    if (const auto usable = check_multicast(group, found); usable != cles::interfaces_of(group) || usable.empty()) {
        wanted.addresses.narrow_group_to(usable); // there is more to be found out without the others
    }
    client asker{wanted.addresses, verbosity};
    const auto code = asker.run(ask_around(asker, wanted.addresses, found));
    if (code != exit_code::success) {
        return code; // interrupted
    }
    check_clock(found);
    check_limits(found);
    if (resolved(wanted.format) == output_format::table) {
        write_output(to_text(found));
    } else {
        printer{wanted.format, false}.print(to_json(found));
    }
    return has_failure(found) ? exit_code::local_failure : exit_code::success;
}

} // namespace

void add_doctor(CLI::App& app, context& shared) {
    auto wanted = std::make_shared<doctor_command>();
    auto* command = app.add_subcommand("doctor", "Find out what keeps nodes from working together");
    wanted->addresses.add_options(*command);
    add_output_option(*command, wanted->format);
    command->footer(
        "Looks at the configuration of clesd, interfaces, multicast, ports, nodes, the clock and limits, and "
        "says\nwhat is wrong and what to do about it. Ends with 1 where something fails.\n\n"
        "Examples:\n"
        "  cles doctor\n"
        "  cles doctor -m eth0\n"
        "  cles doctor --at tcp://10.0.0.7 -o json | jq -r '.findings[] | select(.verdict != \"ok\")'");
    command->callback([wanted, &shared] { shared.exit_code = examine(*wanted, shared.verbosity); });
}

} // namespace tool
