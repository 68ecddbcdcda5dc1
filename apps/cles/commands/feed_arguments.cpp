// SPDX-License-Identifier: BSL-1.0
#include "commands/feed_arguments.hpp"

#include <cles/error.hpp>

#include "client/client.hpp"
#include "discovery/find_nodes.hpp"
#include "discovery/noun_finder.hpp"
#include "options/arguments.hpp"
#include "options/common_options.hpp"
#include "options/noun_pattern.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <string>
#include <utility>

namespace tool {

namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

namespace {

constexpr std::size_t most_nouns = 4096;
constexpr std::chrono::milliseconds time_between_searches{1000};
constexpr std::chrono::seconds silence{5}; // then a user wants to know why nothing comes

// What a node tells may be anything.
bool is_valid_noun(const std::string& noun) {
    try {
        check_noun(noun);
        return true;
    } catch (const usage_error&) {
        return false;
    }
}

// Notes why a search has failed. Returns false if it waits for what is only not there yet.
bool note_obstacle(const std::exception_ptr& failure, bool waits) {
    try {
        std::rethrow_exception(failure);
    } catch (const cles::error& e) {
        const bool may_pass = e.code().category() == cles::error_category() && e.code() != cles::errc::denied;
        if (waits && may_pass) {
            return false;
        }
        note(std::string{e.what()} + (waits ? "; still trying" : ""));
    }
    return true;
}

} // namespace

CLI::Option* feed_arguments::add_options(CLI::App& command, const std::string& count_help) {
    auto* option = command.add_option("noun", nouns,
                                      "NODE:TASK or NODE:TASK/PARAMETER..., several, or patterns such as car1:** and "
                                      "all:loc*; NODE may be self or all");
    option->type_name("");
    addresses.add_options(command, "Bind by multicast on these interfaces, which is the default for all:TASK");
    add_timeout(command, timeout, "5s");
    add_count(command, count, count_help);
    add_duration(command, "--duration", duration, "End after this time, with success (default: never)");
    add_duration(command, "--every", every, "At most one update per interval, always the newest");
    command.add_option("--keep", keep, "Updates that the publisher queues if this subscriber is slow (default 64)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""));
    add_hops(command, hops);
    return option;
}

bool feed_arguments::is_multicast(const std::string& noun) const {
    const bool is_of_all = noun.starts_with("all:") && noun.find('*') == std::string::npos;
    return (addresses.has_group() && addresses.group().is_on()) || (is_of_all && !addresses.has_at());
}

bool feed_arguments::uses_multicast() const {
    return std::any_of(nouns.begin(), nouns.end(), [this](const auto& noun) { return is_multicast(noun); });
}

bool feed_arguments::is_of_many() const { return nouns.size() > 1 || nouns.front().find('*') != std::string::npos; }

void feed_arguments::check() const {
    for (const auto& noun : nouns) {
        const noun_pattern pattern{noun};
        if (pattern.target() == "any") {
            throw usage_error("'" + noun +
                              "': a binding stays with its publisher, so it needs the name of one, or all");
        }
    }
    if (addresses.has_group() && addresses.has_at()) {
        throw usage_error("--multicast and --at cannot be combined");
    }
}

cles::bind_options feed_arguments::options(const client& requester, const std::string& noun,
                                           const std::string& url) const {
    if (is_multicast(noun)) {
        cles::bind_options multicast_only;
        multicast_only.multicast();
        return multicast_only;
    }
    cles::bind_options out;
    if (url.empty()) {
        const auto call = requester.options_for(noun, timeout);
        out.at(call.at_, call.at_node_).deadline(call.deadline_);
    } else {
        out.at(url, target_of(noun)).deadline(timeout.value_or(std::chrono::milliseconds{0}));
    }
    out.hops(hops).every(every);
    if (keep != 0) {
        out.keep(keep);
    }
    return out;
}

void feed_arguments::prepare(client& requester) const {
    if (!is_of_many()) {
        requester.explain_failures_of(nouns.front());
    }
    if (duration.count() > 0) {
        requester.end_after(duration);
    }
}

asio::awaitable<void> follow(client& requester, const feed_arguments& args, feed_set::receiver on_item,
                             feed_set::bound_function on_bound) {
    feed_set feeds{requester, std::move(on_item), std::move(on_bound)};
    std::vector<noun_pattern> patterns;
    for (const auto& noun : args.nouns) {
        noun_pattern pattern{noun};
        if (pattern.is_noun()) {
            feeds.add(noun, args.options(requester, noun, {}),
                      args.waits ? feed_set::failing::waits : feed_set::failing::ends);
        } else {
            patterns.push_back(std::move(pattern));
        }
    }
    noun_finder finder{requester, args.addresses, patterns};
    bool is_full = false;
    bool has_noted = false;
    bool has_told = false;
    const auto tells_at = steady::now() + silence;
    for (bool has_ended = false; !has_ended;) {
        if (!patterns.empty()) {
            const auto found = co_await finder.find();
            for (const auto& each : found) {
                if (feeds.contains(each.noun) || !is_valid_noun(each.noun)) {
                    continue;
                }
                if (feeds.size() < most_nouns) {
                    feeds.add(each.noun, args.options(requester, each.noun, each.url),
                              args.waits ? feed_set::failing::waits_or_leaves_out : feed_set::failing::leaves_out);
                } else if (!is_full) {
                    is_full = true;
                    note("more than " + std::to_string(most_nouns) + " nouns match: " + each.noun +
                         " and others are left out");
                }
            }
        }
        if (feeds.size() == 0 && !args.waits) {
            if (finder.failure()) {
                std::rethrow_exception(finder.failure());
            }
            throw cles::error(cles::errc::no_task, "nobody publishes a noun that matches; --wait waits for one");
        }
        if (finder.failure() && !has_noted) {
            has_noted = note_obstacle(finder.failure(), args.waits);
        }
        if (feeds.size() == 0 && !has_told && steady::now() >= tells_at) {
            has_told = true;
            const bool hears_others = co_await hears_other_pools(requester);
            note(std::string{"nothing that matches is published yet; still waiting"} +
                 (hears_others ? "; nodes of other pools are heard: --pool NAME selects a pool" : ""));
        }
        const bool searches = args.waits && !patterns.empty();
        const auto until = searches ? steady::now() + time_between_searches : steady::time_point::max();
        const bool ended = co_await feeds.wait_until(until);
        has_ended = ended;
    }
}

asio::awaitable<void> follow_values(client& requester, const feed_arguments& args,
                                    std::function<void(const std::string& noun, const feed_set::item& what)> show) {
    std::uint64_t shown = 0;
    const feed_set::receiver on_item = [&](const std::string& noun, const feed_set::item& item) {
        if (item.has_value()) {
            show(noun, item);
            ++shown;
        } else {
            note_event(noun, item);
        }
        return args.count == 0 || shown < args.count;
    };
    co_await follow(requester, args, on_item);
}

event_source source_of(const std::string& noun, const feed_set::item& what) {
    const std::string target{target_of(noun)};
    return {.node = what.publisher.empty() ? target : what.publisher, .path = noun.substr(target.size() + 1)};
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
