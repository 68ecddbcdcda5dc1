// SPDX-License-Identifier: BSL-1.0
#include "node/membership/peer_table.hpp"

#include "json/json_members.hpp"
#include "node/membership/announcement.hpp"
#include "protocol/datagram.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

namespace cles::core {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t table_depth = 8;
constexpr milliseconds max_age = std::chrono::hours{24};
constexpr std::size_t room_for_head = 256; // for the other members of the table, and the head of the reply

std::int64_t age_of(time_point last_seen, time_point now) {
    return std::max<std::int64_t>(0, std::chrono::ceil<milliseconds>(now - last_seen).count());
}

void write_endpoints(json_writer& w, const std::vector<std::string>& endpoints, std::size_t count) {
    w.plain_key("endpoints");
    w.begin_array();
    for (std::size_t i = 0; i < std::min(count, endpoints.size()); ++i) {
        w.value(std::string_view{endpoints[i]});
    }
    w.end_array();
}

struct entry_text {
    std::string_view node;
    std::string_view epoch;
    std::uint64_t seq;
    std::int64_t age;
    std::string_view state;
    const announcement* announced; // null: another node that has left, of which only the name is reported
    const std::vector<std::string>* endpoints;
};

void write_entry(json_writer& w, const entry_text& e, std::size_t endpoints) {
    w.begin_object();
    w.plain_key("node");
    w.value(e.node);
    if (e.announced != nullptr && !e.announced->pool.empty()) {
        w.plain_key("pool");
        w.value(std::string_view{e.announced->pool});
    }
    if (e.announced != nullptr) {
        write_endpoints(w, *e.endpoints, endpoints);
    }
    w.plain_key("epoch");
    w.value(e.epoch);
    if (e.seq != 0) {
        w.plain_key("seq");
        w.value(e.seq);
    }
    w.plain_key("age_ms");
    w.value(e.age);
    if (e.announced != nullptr) {
        w.plain_key("interval_ms");
        w.value(std::int64_t{e.announced->interval.count()});
    }
    w.plain_key("state");
    w.value(e.state);
    if (e.announced != nullptr) {
        w.plain_key("load");
        write_load(w, e.announced->load);
        w.plain_key("tasks");
        w.value(std::string_view{e.announced->tasks});
    }
    w.end_object();
}

void write_entry(json_writer& w, const delta_entry& item, time_point now, std::size_t endpoints) {
    const bool left = item.what == delta_entry::kind::leave;
    write_entry(w,
                {item.node, protocol::epoch_text(item.epoch), item.seq, age_of(item.last_seen, now),
                 left ? "left" : to_string(item.state), item.announced, item.endpoints},
                endpoints);
}

void write_heartbeat(json_writer& w, const delta_entry& item, time_point now) {
    w.plain_key(protocol::epoch_text(item.epoch));
    w.begin_array();
    w.value(item.seq);
    w.value(age_of(item.last_seen, now));
    w.value(std::int64_t{item.announced->interval.count()});
    w.value(std::uint64_t{item.announced->load.queued});
    w.value(std::uint64_t{item.announced->load.running});
    w.end_array();
}

/// The part of the changes that fits into one reply.
struct page {
    std::string peers = "[";
    std::string beats = "{";
    std::uint64_t next = 0;
    bool more = false;

    [[nodiscard]] std::size_t size() const noexcept { return peers.size() + beats.size(); }
};

// Adds the requested descriptions. Those of unchanged nodes go first, because their revision was already sent.
void describe(std::vector<delta_entry>& items, const membership& others, std::string_view epochs, std::uint64_t sent) {
    for (; !epochs.empty(); epochs.remove_prefix(std::min<std::size_t>(epochs.size(), 9))) {
        const auto epoch = protocol::parse_epoch(epochs.substr(0, 8));
        const auto item = epoch ? others.description_of(*epoch) : std::nullopt;
        if (!item) {
            continue;
        }
        const auto known = std::find_if(items.begin(), items.end(), [&](const auto& i) { return i.epoch == *epoch; });
        if (known != items.end()) {
            known->what = delta_entry::kind::description;
        } else {
            items.insert(items.begin(), *item);
            items.front().revision = sent;
        }
    }
}

page page_of(const std::vector<delta_entry>& items, std::uint64_t latest, std::size_t longest, time_point now) {
    page p;
    json_writer peers{p.peers}; // both write after the opening bracket
    json_writer beats{p.beats};
    for (const auto& item : items) {
        const auto peers_before = p.peers.size();
        const auto beats_before = p.beats.size();
        const bool first = &item == &items.front();
        if (item.what == delta_entry::kind::heartbeat) {
            write_heartbeat(beats, item, now);
        } else {
            write_entry(peers, item, now, max_endpoints);
        }
        if (p.size() > longest && !first) {
            p.peers.resize(peers_before);
            p.beats.resize(beats_before);
            p.more = true;
            break;
        }
        if (p.size() > longest && item.what == delta_entry::kind::description) {
            // Not even one entry fits: it is written with fewer endpoints.
            for (auto count = item.endpoints->size(); p.size() > longest && count-- > 0;) {
                p.peers.resize(peers_before);
                write_entry(peers, item, now, count);
            }
        }
        p.next = item.revision;
    }
    if (!p.more) {
        p.next = latest;
    }
    p.peers.push_back(']');
    p.beats.push_back('}');
    return p;
}

bool read_age(json_reader& r, milliseconds& out) {
    std::uint64_t ms = 0;
    if (!r.read(ms)) {
        return false;
    }
    out = milliseconds{std::min<std::uint64_t>(ms, static_cast<std::uint64_t>(max_age.count()))};
    return true;
}

bool read_epoch(json_reader& r, std::uint32_t& out) {
    std::string_view text;
    if (!r.read(text)) {
        return false;
    }
    const auto epoch = protocol::parse_epoch(text);
    if (!epoch) {
        return r.fail("an epoch has 8 hex digits");
    }
    out = *epoch;
    return true;
}

bool read_state(json_reader& r, bool& left) {
    std::string_view state;
    if (!r.read(state)) {
        return false;
    }
    left = state == "left";
    return true;
}

bool read_entry(std::string_view json, peer_report& out) {
    out = {};
    bool has_epoch = false;
    json_reader r{json, table_depth};
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "epoch") {
            return has_epoch = read_epoch(r, out.epoch);
        }
        if (key == "seq") {
            return r.read(out.seq);
        }
        if (key == "age_ms") {
            return read_age(r, out.age);
        }
        if (key == "state") {
            return read_state(r, out.announced.leaving);
        }
        if (key == "leaving") {
            return r.skip();
        }
        out.has_interval |= key == "interval_ms";
        return read_announcement_member(r, key, out.announced);
    });
    return good && has_epoch && protocol::is_name(out.announced.node) &&
           !protocol::is_reserved_target(out.announced.node);
}

bool read_entries(json_reader& r, std::size_t most, table_reader& to) {
    if (!r.begin_array()) {
        return false;
    }
    peer_report report;
    while (r.next_element()) {
        std::string_view text;
        if (!r.read_raw(text)) {
            return false;
        }
        if (most == 0) {
            continue;
        }
        --most;
        if (read_entry(text, report)) {
            to.on_report(report);
        } else {
            to.on_bad_entry();
        }
    }
    return r.ok();
}

bool read_number(json_reader& r, std::uint64_t& out) { return r.next_element() && r.read(out); }

bool read_heartbeat(json_reader& r, peer_heartbeat& out) {
    constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
    std::uint64_t age = 0;
    std::uint64_t interval = 0;
    std::uint64_t queued = 0;
    std::uint64_t running = 0;
    if (!r.begin_array() || !read_number(r, out.seq) || !read_number(r, age) || !read_number(r, interval) ||
        !read_number(r, queued) || !read_number(r, running)) {
        return false;
    }
    while (r.next_element()) { // values of later versions
        r.skip();
    }
    out.age = milliseconds{std::min<std::uint64_t>(age, static_cast<std::uint64_t>(max_age.count()))};
    out.interval =
        std::clamp(milliseconds{std::min<std::uint64_t>(interval, static_cast<std::uint64_t>(max_interval.count()))},
                   min_interval, max_interval);
    out.queued = static_cast<std::uint32_t>(std::min(queued, most));
    out.running = static_cast<std::uint32_t>(std::min(running, most));
    return r.ok();
}

bool read_heartbeats(json_reader& r, std::size_t most, table_reader& to) {
    return read_members(r, [&](std::string_view key) {
        peer_heartbeat beat;
        const auto epoch = protocol::parse_epoch(key);
        if (!epoch || most == 0) {
            return r.skip();
        }
        --most;
        beat.epoch = *epoch;
        if (!read_heartbeat(r, beat)) {
            return false;
        }
        to.on_heartbeat(beat);
        return true;
    });
}

} // namespace

void write_delta(json_writer& w, const table_owner& who, const membership& others, const table_question& asked,
                 std::size_t longest, time_point now) {
    std::uint64_t sent = 0;
    if (asked.since.size() > 9 && asked.since.starts_with(who.epoch) && asked.since[8] == '.') {
        sent = protocol::parse_number(asked.since.substr(9)).value_or(0);
    }
    if (sent > others.latest_revision()) {
        sent = 0;
    }
    auto items = others.deltas_since(sent, now);
    describe(items, others, asked.describe, sent);
    const auto room = std::min(longest, table_page);
    const auto p = page_of(items, others.latest_revision(), room > room_for_head ? room - room_for_head : 0, now);
    w.begin_object();
    w.plain_key("node");
    w.value(who.node);
    w.plain_key("epoch");
    w.value(who.epoch);
    if (!others.pool().empty()) {
        w.plain_key("pool");
        w.value(std::string_view{others.pool()});
    }
    w.plain_key("peers");
    w.raw(p.peers);
    w.plain_key("beats");
    w.raw(p.beats);
    w.plain_key("next");
    w.value(std::string_view{std::string{who.epoch} + "." + std::to_string(p.next)});
    if (p.more) {
        w.plain_key("more");
        w.value(true);
    }
    w.end_object();
}

void write_own_entry(json_writer& w, const announcement& said, std::string_view epoch, std::uint64_t seq,
                     milliseconds age) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    write_entry(w, {said.node, epoch, seq, age.count(), said.leaving ? "left" : "live", &said, &said.endpoints},
                max_endpoints);
    w.end_array();
    w.end_object();
}

bool read_table(std::string_view json, std::size_t max_entries, table_reader& to, table_head& head) {
    head = {};
    json_reader r{json, table_depth};
    bool has_peers = false;
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "peers") {
            has_peers = true;
            return read_entries(r, max_entries, to);
        }
        if (key == "beats") {
            return read_heartbeats(r, max_entries, to);
        }
        return key == "node"    ? r.read(head.node)
               : key == "epoch" ? r.read(head.epoch)
               : key == "pool"  ? r.read(head.pool)
               : key == "next"  ? r.read(head.next)
               : key == "more"  ? r.read(head.more)
                                : r.skip();
    });
    return good && has_peers;
}

bool read_description(std::string_view json, peer_report& out) {
    out = {};
    bool has_epoch = false;
    json_reader r{json};
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "epoch") {
            return has_epoch = read_epoch(r, out.epoch);
        }
        return key == "node" || key == "endpoints" || key == "pool" ? read_announcement_member(r, key, out.announced)
                                                                    : r.skip();
    });
    return good && has_epoch && protocol::is_name(out.announced.node) &&
           !protocol::is_reserved_target(out.announced.node);
}

void write_peers(json_writer& w, const membership& others, time_point now) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    for (const auto& p : others.list(now)) {
        w.begin_object();
        w.plain_key("node");
        w.value(std::string_view{p.node});
        if (!others.pool().empty()) {
            w.plain_key("pool");
            w.value(std::string_view{others.pool()});
        }
        w.plain_key("endpoints");
        w.begin_array();
        for (const auto& endpoint : p.endpoints) {
            w.value(std::string_view{endpoint});
        }
        w.end_array();
        w.plain_key("epoch");
        w.value(std::string_view{p.epoch});
        w.plain_key("age_ms");
        w.value(std::int64_t{p.age.count()});
        w.plain_key("state");
        w.value(to_string(p.state));
        w.plain_key("load");
        write_load(w, p.load);
        w.end_object();
    }
    w.end_array();
    w.end_object();
}

} // namespace cles::core
