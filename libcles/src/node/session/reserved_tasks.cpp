// SPDX-License-Identifier: BSL-1.0
#include "node/session/reserved_tasks.hpp"

#include <cles/json_reader.hpp>
#include <cles/version.hpp>

#include "node/membership/peer_table.hpp"
#include "node/membership/reachable_endpoints.hpp"

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles::core {
namespace {

void write_task(json_writer& w, std::string_view verb, std::string_view task, const task_info& info) {
    w.begin_object();
    w.key("verb");
    w.value(verb);
    w.key("task");
    w.value(task);
    if (!info.description.empty()) {
        w.key("description");
        w.value(std::string_view{info.description});
    }
    if (!info.parameters.empty()) {
        w.key("parameters");
        w.begin_array();
        for (const auto& p : info.parameters) {
            w.value(std::string_view{p});
        }
        w.end_array();
    }
    if (info.idempotent) {
        w.key("idempotent");
        w.value(true);
    }
    w.end_object();
}

std::int64_t milliseconds_since(time_point then, time_point now) {
    return std::chrono::duration_cast<std::chrono::milliseconds>(now - then).count();
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

void serve_peers(node_state& host, reply_writer& replies, const protocol::request_line& r) {
    const auto now = host.time.now();
    if (r.since.empty() || host.gossip_responder == nullptr) {
        replies.write(r, [&](json_writer& w) { write_peers(w, host.peers, now); });
        return;
    }
    replies.write(r, [&](json_writer& w) {
        host.gossip_responder->write_delta(w, {r.since, r.describe}, replies.longest(), now);
    });
}

} // namespace

void write_tasks(json_writer& w, const node_state& n) {
    w.begin_array();
    for (const auto& [task, handlers] : n.tasks.tasks()) {
        for (std::size_t i = 0; i < verb_count; ++i) {
            const bool opened = static_cast<verb>(i) == verb::bind && !handlers[i].present &&
                                (n.tasks.can_bind(task) || n.published.knows(task));
            if (handlers[i].present || opened) {
                write_task(w, verb_names[i], task, handlers[i].info);
            }
        }
    }
    for (const auto& task : n.published.tasks()) {
        if (!n.tasks.tasks().contains(task)) {
            write_task(w, to_string(verb::bind), task, {});
        }
    }
    w.end_array();
}

void write_description(json_writer& w, const node_state& n) {
    w.begin_object();
    w.key("node");
    w.value(std::string_view{n.name});
    if (!n.peers.pool().empty()) {
        w.key("pool");
        w.value(std::string_view{n.peers.pool()});
    }
    w.key("version");
    w.value(std::string_view{version});
    w.key("protocol");
    w.value(std::int64_t{1});
    w.key("features"); // additions to the first version that it understands
    w.begin_array();
    w.value(std::string_view{"mark"});
    w.end_array();
    w.key("epoch");
    w.value(std::string_view{n.epoch});
    w.key("uptime_ms");
    w.value(milliseconds_since(n.started, n.time.now()));
    w.key("endpoints");
    w.begin_array();
    for (const auto& endpoint : n.endpoints) {
        w.value(std::string_view{endpoint});
    }
    w.end_array();
    w.key("tasks");
    write_tasks(w, n);
    w.key("load");
    write_load(w, n.load_now());
    w.end_object();
}

void write_metrics(json_writer& w, const node_state& n) {
    const auto number = [&](std::string_view name, std::uint64_t value) {
        w.key(name);
        w.value(value);
    };
    const auto& c = n.counts;
    w.begin_object();
    w.key("uptime_ms");
    w.value(milliseconds_since(n.started, n.time.now()));
    w.key("requests");
    w.begin_object();
    for (std::size_t i = 0; i < verb_count; ++i) {
        number(verb_names[i], c.requests[i]);
    }
    w.end_object();
    number("errors", c.errors);
    number("errors_unsent", c.errors_unsent);
    number("housekeeping", c.housekeeping);
    number("housekeeping_errors", c.housekeeping_errors);
    number("handlers_running", c.handlers_running);
    number("routed", c.routed);
    number("requests_repeated", c.requests_repeated);
    number("requests_sent", c.requests_sent);
    number("requests_resent", c.requests_resent);
    number("replies_dropped", c.replies_dropped);
    number("updates_published", c.updates_published);
    number("nouns_retired", c.nouns_retired);
    number("updates_delivered", c.updates_delivered);
    number("updates_shed", c.updates_shed);
    number("updates_too_large", c.updates_too_large);
    number("updates_received", c.updates_received);
    number("updates_dropped", c.updates_dropped);
    number("announcements_sent", c.announcements_sent);
    number("announcements_received", c.announcements_received);
    number("announcements_dropped", c.announcements_dropped);
    number("announcements_foreign", c.announcements_foreign);
    number("peers_known", n.peers.size());
    number("peers_refused", c.peers_refused);
    number("tables_asked", c.tables_requested);
    number("tables_failed", c.tables_failed);
    number("tables_told", c.tables_sent);
    number("entries_dropped", c.entries_dropped);
    number("leases_expired", c.leases_expired);
    number("datagrams_withheld", c.datagrams_withheld);
    number("group_received", c.group_received);
    number("group_dropped", c.group_dropped);
    number("group_repeated", c.group_repeated);
    number("group_sent", c.group_sent);
    number("group_unsent", c.group_unsent);
    number("group_leases", c.group_leases);
    number("links_open", c.links_open);
    number("links_accepted", c.links_accepted);
    number("links_refused", c.links_refused);
    number("links_evicted", c.links_evicted);
    number("links_lost", c.links_lost);
    number("bytes_received", c.bytes_received);
    number("bytes_sent", c.bytes_sent);
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
        w.key(name);
        w.value(static_cast<double>(n.handler_time.quantile(q).count()) / 1000.0);
    };
    quantile("p50", 0.5);
    quantile("p99", 0.99);
    quantile("p999", 0.999);
    w.end_object();
    if (n.metrics) {
        if (const auto members = own_metrics(n); !members.empty()) {
            w.raw(members);
        }
    }
    w.end_object();
}

void serve_reserved(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    const auto& parameters = r.noun.parameters;
    if (r.verb == verb::pull && parameters.empty()) {
        replies.write(r, [&](json_writer& w) { write_description(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "metrics") {
        replies.write(r, [&](json_writer& w) { write_metrics(w, host); });
    } else if (r.verb == verb::pull && parameters.size() == 1 && parameters[0] == "peers") {
        serve_peers(host, replies, r);
    } else if (r.verb == verb::push && parameters.size() == 1 && parameters[0] == "peers" &&
               host.gossip_responder != nullptr) {
        if (host.gossip_responder->on_pushed_table(r.body, observed_source::of(peer), host.time.now())) {
            replies.done(reply_target{r}, {});
        } else {
            replies.fail(r, errc::bad_request, host.name + ": the body is no table of nodes");
        }
    } else if (r.verb == verb::push && parameters.size() == 2 && parameters[0] == "cancel") {
        replies.fail(r, errc::bad_request, host.name + ": cancel needs an id from 1 to 2^63-1");
    } else {
        replies.fail(r, errc::no_task,
                     host.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.path} + "'");
    }
}

} // namespace cles::core
