// SPDX-License-Identifier: BSL-1.0
#include "core/node.hpp"

#include <cles/json_reader.hpp>
#include <cles/version.hpp>

#include "protocol/message.hpp"

#include <chrono>
#include <utility>

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

} // namespace

node::node(node_setup setup, const core::clock& source, std::function<void()> wake)
    : name(std::move(setup.name)), epoch(protocol::epoch_text(setup.epoch)), first_datagram_id(setup.first_datagram_id),
      bounds(setup.bounds), authorise(std::move(setup.authorise)), log(std::move(setup.log)),
      metrics(std::move(setup.metrics)), load(std::move(setup.load)), time(source), started(source.now()),
      completions(std::move(setup.complete)), memory(bounds.memory),
      kept_values(std::make_shared<memory_account>(memory, memory_account::share::half)),
      kept_requests(std::make_shared<memory_account>(memory)), others(name, setup.epoch, deadlines, bounds.peers),
      published({deadlines, counts, bounds.binding_bytes, kept_values}, bounds, completions, name, epoch,
                std::move(wake)),
      remembered{.limit = bounds.remembered} {
    others.begin(setup.pool, started);
}

// What is handed on to other nodes is work of theirs.
node_load node::load_now() const noexcept {
    try {
        if (load) {
            return load();
        }
    } catch (...) { // as where there is no function
    }
    return {.running = static_cast<std::uint32_t>(counts.handlers_running - counts.routed)};
}

void node::say(log_level level, const log_entry& what) const noexcept {
    try {
        if (log) {
            log(level, what);
        }
    } catch (...) { // there is nobody to tell
    }
}

void node::say_soon(log_level level, std::string what, std::string peer) {
    if (log) {
        completions.call([log = log, level, what = std::move(what), peer = std::move(peer)] {
            try {
                log(level, {what, peer});
            } catch (...) { // there is nobody to tell
            }
        });
    }
}

namespace {

// What the program counts, as members of an object; empty where its function throws or writes no JSON.
std::string own_metrics(const node& n) {
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

} // namespace

void write_tasks(json_writer& w, const node& n) {
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

void write_description(json_writer& w, const node& n) {
    w.begin_object();
    w.key("node");
    w.value(std::string_view{n.name});
    if (!n.others.pool().empty()) {
        w.key("pool");
        w.value(std::string_view{n.others.pool()});
    }
    w.key("version");
    w.value(std::string_view{version});
    w.key("protocol");
    w.value(std::int64_t{1});
    w.key("features"); // what may be sent to it beyond the first version
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

void write_metrics(json_writer& w, const node& n) {
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
    number("peers_known", n.others.size());
    number("peers_refused", c.peers_refused);
    number("tables_asked", c.tables_asked);
    number("tables_failed", c.tables_failed);
    number("tables_told", c.tables_told);
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

} // namespace cles::core
