// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcement.hpp"

#include "json/json_members.hpp"
#include "node/session/task_execution.hpp"
#include "protocol/fnv1a.hpp"
#include "protocol/grammar.hpp"
#include "protocol/hex_number.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <limits>

namespace cles::core {
namespace {

constexpr std::size_t depth = 8; // allows for additions of later versions

bool read_endpoints(json_reader& r, std::vector<std::string>& out) {
    out.clear();
    return read_texts(r, [&out](std::string_view url) {
        if (out.size() < max_endpoints && !url.empty() && url.size() <= max_endpoint) {
            out.emplace_back(url);
        }
    });
}

// A source that cannot be read is skipped: it may be of a later version.
bool read_sources(json_reader& r, std::vector<group_source>& out) {
    out.clear();
    return read_texts(r, [&out](std::string_view text) {
        if (const auto source = parse_group_source(text); source && out.size() < max_sources) {
            out.push_back(*source);
        }
    });
}

// None may be skipped: an update without a signature would be accepted.
bool read_signed(json_reader& r, std::vector<std::string>& out) {
    out.clear();
    std::size_t bytes = 0;
    const bool good = read_texts(r, [&](std::string_view task) {
        bytes += task.size() + 1;
        if (bytes <= 2 * task_registry::max_signed_names) {
            out.emplace_back(task);
        }
    });
    return good && (bytes <= 2 * task_registry::max_signed_names || r.fail("the list of signed tasks is too long"));
}

// None may be skipped: the node would be asked by others than it allows.
bool read_links(json_reader& r, std::vector<std::string>& out) {
    out.clear();
    const bool good = read_texts(r, [&out](std::string_view node) {
        if (out.size() <= max_links) {
            out.emplace_back(node);
        }
    });
    return good && ((out.size() <= max_links && std::ranges::all_of(out, protocol::is_name)) ||
                    r.fail("'links' is a list of up to 16 names"));
}

bool read_digest(json_reader& r, std::string& out) {
    if (!r.read(out)) {
        return false;
    }
    return out.size() <= max_digest || r.fail("the digest has more than 64 bytes");
}

} // namespace

bool read_load(json_reader& r, node_load& out) {
    out = {};
    return read_members(r, [&](std::string_view key) {
        return key == "queued"       ? read_count(r, out.queued)
               : key == "running"    ? read_count(r, out.running)
               : key == "workers"    ? read_count(r, out.workers)
               : key == "service_us" ? read_count(r, out.service_us)
                                     : r.skip();
    });
}

std::chrono::milliseconds interval_among(std::size_t others) noexcept {
    return std::clamp(interval_per_node * static_cast<std::int64_t>(others + 1), usual_interval, max_interval);
}

bool read_epoch(json_reader& r, std::optional<std::uint32_t>& out) {
    std::string_view text;
    if (!r.read(text)) {
        return false;
    }
    out = protocol::parse_epoch(text);
    return out || r.fail("an epoch has 8 hex digits");
}

bool read_milliseconds(json_reader& r, std::chrono::milliseconds& out, std::chrono::milliseconds most) {
    std::uint64_t ms = 0;
    const bool good = r.read(ms);
    out = std::chrono::milliseconds{std::min(ms, static_cast<std::uint64_t>(most.count()))};
    return good;
}

bool read_count(json_reader& r, std::uint32_t& out) {
    std::uint64_t wide = 0;
    const bool good = r.read(wide);
    out = static_cast<std::uint32_t>(std::min<std::uint64_t>(wide, std::numeric_limits<std::uint32_t>::max()));
    return good;
}

bool read_interval(json_reader& r, std::chrono::milliseconds& out) {
    const bool good = read_milliseconds(r, out, max_interval);
    out = std::max(out, min_interval);
    return good;
}

bool read_announcement_member(json_reader& r, std::string_view key, announcement& out) {
    return key == "node"          ? r.read(out.node)
           : key == "endpoints"   ? read_endpoints(r, out.endpoints)
           : key == "load"        ? read_load(r, out.load)
           : key == "interval_ms" ? read_interval(r, out.interval)
           : key == "tasks"       ? read_digest(r, out.tasks)
           : key == "leaving"     ? r.read(out.leaving)
           : key == "pool"        ? r.read(out.pool)
           : key == "sources"     ? read_sources(r, out.sources)
           : key == "roster"      ? read_count(r, out.roster)
           : key == "signed"      ? read_signed(r, out.signed_tasks)
           : key == "links"       ? read_links(r, out.links)
                                  : r.skip();
}

namespace {

bool read_body(json_reader& r, announcement& out) {
    const bool good = read_members(r, [&](std::string_view key) {
        const std::string name{key};
        if (!read_announcement_member(r, name, out)) {
            r.inside_member(name);
            return false;
        }
        return true;
    });
    return good && r.at_end();
}

} // namespace

void append_announcement_body(std::string& out, const announcement& said, std::size_t endpoints) {
    json_writer w{out};
    w.begin_object();
    write_member(w, "node", said.node);
    if (!said.pool.empty()) {
        write_member(w, "pool", said.pool);
    }
    write_endpoints_member(w, said.endpoints, endpoints);
    if (!said.sources.empty()) {
        w.plain_key("sources");
        w.begin_array();
        for (const auto& source : said.sources) {
            w.value(std::string_view{to_text(source)});
        }
        w.end_array();
    }
    write_load_member(w, said.load);
    write_member(w, "interval_ms", said.interval.count());
    write_member(w, "tasks", said.tasks);
    if (said.leaving) {
        write_member(w, "leaving", true);
    }
    if (said.roster != 0) {
        write_member(w, "roster", said.roster);
    }
    write_list_member(w, "signed", said.signed_tasks);
    write_list_member(w, "links", said.links);
    w.end_object();
}

void write_list_member(json_writer& w, std::string_view name, const std::vector<std::string>& all) {
    if (!all.empty()) {
        write_member(w, name, all);
    }
}

bool read_signed_member(json_reader& r, std::string_view key, signed_entry& out) {
    return key == "announced" ? r.read_raw(out.body)
           : key == "epoch"   ? read_epoch(r, out.epoch)
           : key == "seq"     ? r.read(out.seq)
           : key == "sig"     ? r.read(out.sig)
                              : r.skip();
}

void write_signed_members(json_writer& w, const signed_announcement& said, std::uint64_t seq, std::string_view epoch) {
    w.plain_key("announced");
    w.raw(said.body);
    write_member(w, "seq", seq);
    write_member(w, "epoch", epoch);
    write_member(w, "sig", said.sig);
}

void write_load_member(json_writer& w, const node_load& load) {
    w.plain_key("load");
    write_load(w, load);
}

void write_load(json_writer& w, const node_load& load) {
    w.begin_object();
    write_member(w, "queued", load.queued);
    write_member(w, "running", load.running);
    write_member(w, "workers", load.workers);
    if (load.service_us != 0) {
        write_member(w, "service_us", load.service_us);
    }
    w.end_object();
}

void write_endpoints_member(json_writer& w, const std::vector<std::string>& endpoints, std::size_t most) {
    w.plain_key("endpoints");
    w.begin_array();
    for (std::size_t i = 0; i < std::min(most, endpoints.size()); ++i) {
        w.value(std::string_view{endpoints[i]});
    }
    w.end_array();
}

bool read_announcement(const protocol::request_line& update, announcement& out, std::string& why) {
    out = {};
    const auto& noun = update.noun;
    if (update.verb != verb::update || !update.is_update() || noun.path != "cles" ||
        protocol::is_reserved_target(noun.target)) {
        why = "an announcement is an update of a node's own task 'cles'";
        return false;
    }
    out.node = noun.target;
    json_reader reader{update.body.empty() ? std::string_view{"{}"} : update.body, depth};
    if (!read_body(reader, out)) {
        why = reader.error();
        return false;
    }
    if (out.node != noun.target) {
        why = "the node announced is not the one of the noun";
        return false;
    }
    return true;
}

bool read_announcement(std::string_view body, announcement& out) {
    json_reader reader{body, depth};
    return read_body(reader, out);
}

void append_announcement(std::string& out, const announcement& said, std::uint64_t seq, std::string_view epoch) {
    const auto start = out.size();
    for (auto endpoints = std::min(said.endpoints.size(), max_endpoints);; --endpoints) {
        protocol::append_update_head(out, said.node, "cles", seq, epoch);
        append_announcement_body(out, said, endpoints);
        out.push_back('\n');
        if (out.size() - start <= protocol::datagram_bytes || endpoints == 0) {
            return;
        }
        out.resize(start);
    }
}

void append_announcement(std::string& out, std::string_view node, const signed_announcement& said, std::uint64_t seq,
                         std::string_view epoch) {
    protocol::append_update_head(out, node, "cles", seq, epoch);
    out.append("sig=").append(said.sig).append(" ").append(said.body).push_back('\n');
}

std::string digest_of_tasks(std::string_view json) { return protocol::hex_text(protocol::fnv1a(json)); }

} // namespace cles::core
