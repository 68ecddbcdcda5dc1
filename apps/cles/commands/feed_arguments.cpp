// SPDX-License-Identifier: BSL-1.0
#include "commands/feed_arguments.hpp"

#include "client/client.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>

namespace tool {

void feed_arguments::add_options(CLI::App& command, const std::string& count_help) {
    add_noun(command, noun, "self or all");
    addresses.add_options(command, "Bind by multicast on these interfaces, which is the default for all:TASK");
    add_timeout(command, timeout, "5s");
    add_count(command, count, count_help);
    add_duration(command, "--duration", duration, "End after this time, with success (default: never)");
    add_duration(command, "--every", every, "At most one update per interval, always the newest");
    command.add_option("--keep", keep, "Updates that the publisher queues if this subscriber is slow (default 64)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""));
    add_hops(command, hops);
}

bool feed_arguments::is_multicast() const {
    return (addresses.has_group() && addresses.group().is_on()) || (noun.starts_with("all:") && !addresses.has_at());
}

void feed_arguments::check() const {
    check_noun(noun);
    if (target_of(noun) == "any") {
        throw usage_error("'" + noun + "': a binding stays with its publisher, so it needs the name of one, or all");
    }
    if (addresses.has_group() && addresses.has_at()) {
        throw usage_error("--multicast and --at cannot be combined");
    }
}

cles::bind_options feed_arguments::options(const client& requester) const {
    if (is_multicast()) {
        cles::bind_options multicast_only;
        multicast_only.multicast();
        return multicast_only;
    }
    const auto call = requester.options_for(noun, timeout);
    cles::bind_options out;
    out.at(call.at_).deadline(call.deadline_).hops(hops).every(every);
    if (keep != 0) {
        out.keep(keep);
    }
    return out;
}

void feed_arguments::prepare(client& requester) const {
    requester.explain_failures_of(noun);
    if (duration.count() > 0) {
        requester.end_after(duration);
    }
}

void note_event(const std::string& noun, const cles::feed_item<cles::json_text>& item) {
    // For `all:`, the node whose update it was.
    const bool is_of_all = noun.starts_with("all:") && !item.publisher.empty();
    const std::string name = is_of_all ? item.publisher + noun.substr(std::min(noun.find(':'), noun.size())) : noun;
    switch (item.kind) {
    case cles::feed_event::gap:
        note(name + ": gap: " + std::to_string(item.missed) + (item.missed == 1 ? " update" : " updates") + " missed");
        break;
    case cles::feed_event::lost: note(name + ": lost: " + item.text + "; binding again"); break;
    case cles::feed_event::rebound: note(name + ": bound again"); break;
    case cles::feed_event::current:
    case cles::feed_event::update: break;
    }
}

} // namespace tool
