// SPDX-License-Identifier: BSL-1.0
#include "commands/feed_command.hpp"

#include "client/client.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/failure.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

namespace tool {

void feed_command::add_options(CLI::App& command, const std::string& count_help) {
    add_noun(command, noun);
    addresses.add_options(command, "Bind by multicast, by which interface; all:TASK goes that way by itself");
    add_timeout(command, timeout, "5s");
    add_count(command, count, count_help);
    add_duration(command, "--duration", duration, "End after this time, with success (default: never)");
    add_duration(command, "--every", every, "At most one update in so long, always the newest");
    command.add_option("--keep", keep, "Updates that the publisher queues while this end is slow (default 64)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""));
}

bool feed_command::is_multicast() const {
    return (addresses.has_group() && addresses.group().is_on()) || (noun.starts_with("all:") && !addresses.has_at());
}

void feed_command::check() const {
    check_noun(noun);
    if (addresses.has_group() && addresses.has_at()) {
        throw usage_error("--multicast and --at: an update comes by the one or by the other");
    }
}

cles::bind_options feed_command::options(const client& asker) const {
    if (is_multicast()) {
        cles::bind_options by_group;
        by_group.multicast();
        return by_group;
    }
    const auto call = asker.options_for(noun, timeout);
    cles::bind_options out;
    out.at(call.at_).deadline(call.deadline_).every(every);
    if (keep != 0) {
        out.keep(keep);
    }
    return out;
}

void feed_command::arm(client& asker) const {
    if (duration.count() > 0) {
        asker.end_after(duration);
    }
}

} // namespace tool
