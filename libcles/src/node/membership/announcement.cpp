// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcement.hpp"

#include "json/json_members.hpp"
#include "protocol/datagram.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <limits>

namespace cles::core {
namespace {

constexpr std::size_t depth = 8; // room for additions of later versions

/// Reads an array of strings and passes each to `take`, valid during the call.
template <class F>
bool read_texts(json_reader& r, F take) {
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        std::string_view text;
        if (!r.read(text)) {
            return false;
        }
        take(text);
    }
    return r.ok();
}

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

bool read_count(json_reader& r, std::uint32_t& out) {
    std::uint64_t wide = 0;
    if (!r.read(wide)) {
        return false;
    }
    out = static_cast<std::uint32_t>(std::min<std::uint64_t>(wide, std::numeric_limits<std::uint32_t>::max()));
    return true;
}

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

bool read_interval(json_reader& r, std::chrono::milliseconds& out) {
    std::uint64_t ms = 0;
    if (!r.read(ms)) {
        return false;
    }
    const auto longest = static_cast<std::uint64_t>(max_interval.count());
    out = std::max(min_interval, std::chrono::milliseconds{std::min(ms, longest)});
    return true;
}

bool read_digest(json_reader& r, std::string& out) {
    if (!r.read(out)) {
        return false;
    }
    return out.size() <= max_digest || r.fail("the digest has more than 64 bytes");
}

} // namespace

bool read_announcement_member(json_reader& r, std::string_view key, announcement& out) {
    if (key == "node") {
        return r.read(out.node);
    }
    if (key == "endpoints") {
        return read_endpoints(r, out.endpoints);
    }
    if (key == "load") {
        return read_load(r, out.load);
    }
    if (key == "interval_ms") {
        return read_interval(r, out.interval);
    }
    if (key == "tasks") {
        return read_digest(r, out.tasks);
    }
    if (key == "leaving") {
        return r.read(out.leaving);
    }
    if (key == "pool") {
        return r.read(out.pool);
    }
    if (key == "sources") {
        return read_sources(r, out.sources);
    }
    return r.skip();
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

void append_body(std::string& out, const announcement& said, std::size_t endpoints) {
    json_writer w{out};
    w.begin_object();
    w.plain_key("node");
    w.value(std::string_view{said.node});
    if (!said.pool.empty()) {
        w.plain_key("pool");
        w.value(std::string_view{said.pool});
    }
    w.plain_key("endpoints");
    w.begin_array();
    for (std::size_t i = 0; i < endpoints; ++i) {
        w.value(std::string_view{said.endpoints[i]});
    }
    w.end_array();
    if (!said.sources.empty()) {
        w.plain_key("sources");
        w.begin_array();
        for (const auto& source : said.sources) {
            w.value(std::string_view{to_text(source)});
        }
        w.end_array();
    }
    w.plain_key("load");
    write_load(w, said.load);
    w.plain_key("interval_ms");
    w.value(std::int64_t{said.interval.count()});
    w.plain_key("tasks");
    w.value(std::string_view{said.tasks});
    if (said.leaving) {
        w.plain_key("leaving");
        w.value(true);
    }
    w.end_object();
}

} // namespace

void write_load(json_writer& w, const node_load& load) {
    w.begin_object();
    w.plain_key("queued");
    w.value(std::uint64_t{load.queued});
    w.plain_key("running");
    w.value(std::uint64_t{load.running});
    w.plain_key("workers");
    w.value(std::uint64_t{load.workers});
    if (load.service_us != 0) {
        w.plain_key("service_us");
        w.value(std::uint64_t{load.service_us});
    }
    w.end_object();
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

void append_announcement(std::string& out, const announcement& said, std::uint64_t seq, std::string_view epoch) {
    const auto start = out.size();
    for (auto endpoints = std::min(said.endpoints.size(), max_endpoints);; --endpoints) {
        protocol::append_update_head(out, said.node, "cles", seq, epoch);
        append_body(out, said, endpoints);
        out.push_back('\n');
        if (out.size() - start <= protocol::datagram_bytes || endpoints == 0) {
            return;
        }
        out.resize(start);
    }
}

std::string digest_of_tasks(std::string_view json) {
    constexpr std::uint64_t basis = 0xcbf29ce484222325; // FNV-1a (Fowler, Noll, Vo)
    constexpr std::uint64_t prime = 0x100000001b3;
    auto hash = basis;
    for (const auto c : json) {
        hash = (hash ^ static_cast<unsigned char>(c)) * prime;
    }
    std::string text(16, '0');
    for (std::size_t i = text.size(); i-- > 0; hash >>= 4U) {
        text[i] = "0123456789abcdef"[hash & 0xFU];
    }
    return text;
}

} // namespace cles::core
