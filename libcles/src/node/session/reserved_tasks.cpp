// SPDX-License-Identifier: BSL-1.0
#include "node/session/reserved_tasks.hpp"

#include <cles/convert.hpp>
#include <cles/json_reader.hpp>
#include <cles/version.hpp>

#include "json/json_members.hpp"
#include "node/membership/gossip.hpp"
#include "node/membership/peer_table.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "node/security_protocol.hpp"
#include "node/session/job_table.hpp"
#include "node/session/task_types.hpp"
#include "node/sharing/movable_request.hpp"
#include "node/tracing/span_recorder.hpp"
#include "port/node_security.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {
namespace {

constexpr std::size_t longest_reply_head = 23; // "id=9223372036854775807 "

void write_task(json_writer& w, std::string_view verb, std::string_view task, const task_info& info, told_tasks told) {
    w.begin_object();
    write_member(w, "verb", verb);
    write_member(w, "task", task);
    if (!info.description.empty() && told == told_tasks::described) {
        write_member(w, "description", std::string_view{info.description});
    }
    if (!info.parameters.empty()) {
        write_member(w, "parameters", info.parameters);
    }
    if (info.idempotent) {
        write_member(w, "idempotent", true);
    }
    if (info.local) {
        write_member(w, "local", true);
    }
    if (info.must_be_signed) {
        write_member(w, "signed", true);
    }
    w.end_object();
}

std::int64_t milliseconds_since(time_point then, time_point now) {
    return std::chrono::duration_cast<std::chrono::milliseconds>(now - then).count();
}

struct counter {
    std::string_view name;
    std::uint64_t counters::*value;
};

// Those that are described.
template <class... D>
constexpr std::array<counter, sizeof...(D)> all_counters(detail::descriptors<D...>) {
    return {counter{D::name, D::pointer}...};
}

// The program's metrics as members of an object; empty if its function throws or does not write valid JSON.
std::string own_metrics(const node_state& n) {
    std::string text;
    try {
        json_writer w{text};
        w.begin_object();
        n.metrics(w);
        w.end_object();
    } catch (...) {
        return {};
    }
    return is_valid_json(text, n.bounds.depth) ? text.substr(1, text.size() - 2) : std::string{};
}

// As much of the description as a datagram holds: others ask for it to learn that the node is there.
std::string description_within(const node_state& n, std::size_t longest) {
    std::string text;
    for (const auto told : {told_tasks::described, told_tasks::named, told_tasks::none}) {
        text.clear();
        json_writer w{text};
        write_description(w, n, told);
        if (text.size() + longest_reply_head <= longest) {
            break;
        }
    }
    return text;
}

void serve_peers(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    const auto now = host.time.now();
    const auto zone = observed_source::of(peer).zone();
    replies.write(r, [&](json_writer& w) {
        if (r.since.empty() || host.gossip_responder == nullptr) {
            write_peers(w, host.list_peers(now), host.peers.pool());
        } else {
            host.gossip_responder->write_delta(w, {r.since, r.describe, r.routes, zone}, replies.longest(), now);
        }
    });
}

/// True if the request is for a task of a part that this node may have: security, types, or jobs. The part has replied.
bool served_by_a_part(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    return (host.secured && host.secured->serve_reserved(replies, r)) ||
           (host.types != nullptr && r.verb == verb::pull && host.types->serve(host, replies, r, peer)) ||
           (host.jobs && host.jobs->serve(host, replies, r, peer));
}

} // namespace

bool is_spans_request(const protocol::request_line& r) noexcept {
    const auto& parameters = r.noun.parameters;
    return r.verb == verb::pull && parameters.size() == 2 && parameters[0] == "trace";
}

void write_tasks(json_writer& w, const node_state& n, told_tasks told) {
    w.begin_array();
    for (const auto& [task, handlers] : n.tasks.tasks()) {
        for (std::size_t i = 0; i < verb_count; ++i) {
            const bool opened = static_cast<verb>(i) == verb::bind && !handlers[i].present &&
                                (n.tasks.can_bind(task) || n.published.knows(task));
            if (handlers[i].present || opened) {
                write_task(w, verb_names[i], task, handlers[i].info, told);
            }
        }
    }
    for (const auto& task : n.published.tasks()) {
        if (!n.tasks.tasks().contains(task)) {
            write_task(w, to_string(verb::bind), task, {}, told);
        }
    }
    w.end_array();
}

void write_description(json_writer& w, const node_state& n, told_tasks told) {
    w.begin_object();
    write_member(w, "node", std::string_view{n.name});
    if (!n.peers.pool().empty()) {
        write_member(w, "pool", std::string_view{n.peers.pool()});
    }
    write_member(w, "version", std::string_view{version});
    write_member(w, "protocol", std::int64_t{1});
    std::vector<std::string> features{"mark"}; // additions to the first version that it understands
    if (n.spans) {
        features.emplace_back("trace");
    }
    if (n.types != nullptr) {
        features.emplace_back("types");
    }
    write_member(w, "features", features);
    w.plain_key("limits"); // of what is sent to it
    w.begin_object();
    write_member(w, "line", std::uint64_t{n.bounds.line});
    w.end_object();
    write_member(w, "epoch", std::string_view{n.epoch});
    write_member(w, "uptime_ms", milliseconds_since(n.started, n.time.now()));
    write_member(w, "endpoints", n.endpoints);
    w.key("tasks");
    if (told != told_tasks::none) {
        write_tasks(w, n, told);
    } else {
        w.null(); // readers would take a list without entries, or none, for a node that offers nothing
    }
    if (n.types != nullptr) {
        write_member(w, "types", n.types->digest(n));
    }
    write_load_member(w, n.load_now());
    if (n.security) {
        write_member(w, "roster", std::uint64_t{n.security->roster_version()});
    }
    w.end_object();
}

void write_metrics(json_writer& w, const node_state& n, shown_counters shown) {
    const auto number = [&](std::string_view name, std::uint64_t value) { write_member(w, name, value); };
    auto counts = n.counts;
    counts.peers_known = n.peers.size();
    counts.datagrams_unsealed = n.security ? n.security->unsealed_datagrams() : 0;
    counts.group_unopened = n.security ? n.security->unopened_group_datagrams() : 0;
    w.begin_object();
    write_member(w, "uptime_ms", milliseconds_since(n.started, n.time.now()));
    w.key("requests");
    w.begin_object();
    for (std::size_t i = 0; i < verb_count; ++i) {
        number(verb_names[i], counts.requests[i]);
    }
    w.end_object();
    static constexpr auto all = all_counters(detail::fields_of<counters>{});
    static_assert(all.size() + verb_count == sizeof(counters) / sizeof(std::uint64_t), "describe every counter");
    for (const auto& c : all) {
        if (counts.*c.value != 0 || shown == shown_counters::all) {
            number(c.name, counts.*c.value);
        }
    }
    w.key("memory");
    w.begin_object();
    number("limit", n.memory.limit());
    number("used", n.memory.used());
    number("values", n.kept_values->used());
    number("requests", n.kept_requests->used());
    number("refused", n.memory.refusals());
    w.end_object();
    w.key("handler_us");
    w.begin_object();
    number("samples", n.handler_time.count());
    const auto quantile = [&](std::string_view name, double q) {
        write_member(w, name, static_cast<double>(n.handler_time.quantile(q).count()) / 1000.0);
    };
    quantile("p50", 0.5);
    quantile("p99", 0.99);
    quantile("p999", 0.999);
    w.end_object();
    if (n.jobs && shown == shown_counters::all) {
        w.plain_key("tasks_us");
        n.jobs->write_times(w);
    }
    if (n.metrics) {
        if (const auto members = own_metrics(n); !members.empty()) {
            w.raw(members);
        }
    }
    w.end_object();
}

void serve_reserved(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    const auto& parameters = r.noun.parameters;
    const auto is = [&r](verb v, std::string_view path) { return r.verb == v && r.noun.path == path; };
    if (is(verb::pull, "cles")) {
        replies.write(r, [&](json_writer& w) {
            if (replies.by_datagram()) {
                w.raw(description_within(host, replies.longest()));
            } else {
                write_description(w, host);
            }
        });
    } else if (is(verb::pull, "cles/metrics")) {
        const auto shown = replies.by_datagram() ? shown_counters::not_zero : shown_counters::all;
        replies.write(r, [&](json_writer& w) { write_metrics(w, host, shown); });
    } else if (is(verb::pull, "cles/peers")) {
        serve_peers(host, replies, r, peer);
    } else if (is(verb::push, "cles/peers") && host.gossip_responder != nullptr) {
        if (host.gossip_responder->on_pushed_table(r.body, observed_source::of(peer), host.time.now())) {
            replies.done(reply_target{r}, {});
        } else {
            replies.fail(r, errc::bad_request, host.name + ": the body is not a table of nodes");
        }
    } else if (is(verb::push, "cles/slots") && host.sharing != nullptr) {
        host.sharing->serve_slots(replies, r, peer, host.time.now());
    } else if (host.spans && is_spans_request(r)) {
        if (const auto id = protocol::parse_trace_id(parameters[1])) {
            replies.write(r, [&](json_writer& w) { host.spans->write(w, *id, host.time.now()); });
        } else {
            replies.fail(r, errc::bad_request, host.name + ": a trace is named by 32 lower-case hex digits, not all 0");
        }
    } else if (served_by_a_part(host, replies, r, peer)) {
        return;
    } else if (r.verb == verb::push && parameters.size() == 2 && parameters[0] == "cancel") {
        replies.fail(r, errc::bad_request, host.name + ": cancel needs an id from 1 to 2^63-1");
    } else {
        replies.fail(r, errc::no_task,
                     host.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.path} + "'");
    }
}

} // namespace cles::core
