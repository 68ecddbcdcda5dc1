// SPDX-License-Identifier: BSL-1.0
#include "core/peer_table.hpp"

#include "core/json_members.hpp"
#include "protocol/grammar.hpp"
#include "protocol/message.hpp"
#include "protocol/parts.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <optional>
#include <vector>

namespace cles::core {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t table_depth = 8;
constexpr milliseconds longest_age = std::chrono::hours{24};
constexpr std::size_t room_for_head = 256; // of an answer, and for its reply's own head

std::int64_t age_of(time_point heard, time_point now) {
    return std::max<std::int64_t>(0, std::chrono::ceil<milliseconds>(now - heard).count());
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
    const announcement* said; // null: it has left
    const std::vector<std::string>* endpoints;
};

void write_entry(json_writer& w, const entry_text& e, std::size_t endpoints) {
    w.begin_object();
    w.plain_key("node");
    w.value(e.node);
    if (e.said != nullptr && !e.said->pool.empty()) {
        w.plain_key("pool");
        w.value(std::string_view{e.said->pool});
    }
    if (e.said != nullptr) {
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
    if (e.said != nullptr) {
        w.plain_key("interval_ms");
        w.value(std::int64_t{e.said->interval.count()});
    }
    w.plain_key("state");
    w.value(e.state);
    if (e.said != nullptr) {
        w.plain_key("load");
        write_load(w, e.said->load);
        w.plain_key("tasks");
        w.value(std::string_view{e.said->tasks});
    }
    w.end_object();
}

void write_entry(json_writer& w, const news_item& item, time_point now, std::size_t endpoints) {
    const bool left = item.what == news_item::kind::farewell;
    write_entry(w,
                {item.node, protocol::epoch_text(item.epoch), item.seq, age_of(item.heard, now),
                 left ? "left" : to_string(item.state), item.said, item.endpoints},
                endpoints);
}

void write_beat(json_writer& w, const news_item& item, time_point now) {
    w.plain_key(protocol::epoch_text(item.epoch));
    w.begin_array();
    w.value(item.seq);
    w.value(age_of(item.heard, now));
    w.value(std::int64_t{item.said->interval.count()});
    w.value(std::uint64_t{item.said->load.queued});
    w.value(std::uint64_t{item.said->load.running});
    w.end_array();
}

/// What of the news goes into one answer.
struct page {
    std::string peers = "[";
    std::string beats = "{";
    std::uint64_t next = 0;
    bool more = false;

    [[nodiscard]] std::size_t size() const noexcept { return peers.size() + beats.size(); }
};

// Those who are to be told of in full though nothing, or less, is new go first: they are old news.
void describe(std::vector<news_item>& items, const presence& others, std::string_view epochs, std::uint64_t told) {
    for (; !epochs.empty(); epochs.remove_prefix(std::min<std::size_t>(epochs.size(), 9))) {
        const auto epoch = protocol::parse_epoch(epochs.substr(0, 8));
        const auto item = epoch ? others.description_of(*epoch) : std::nullopt;
        if (!item) {
            continue;
        }
        const auto known = std::find_if(items.begin(), items.end(), [&](const auto& i) { return i.epoch == *epoch; });
        if (known != items.end()) {
            known->what = news_item::kind::description;
        } else {
            items.insert(items.begin(), *item);
            items.front().news = told;
        }
    }
}

page page_of(const std::vector<news_item>& items, std::uint64_t latest, std::size_t longest, time_point now) {
    page p;
    json_writer peers{p.peers}; // each begins behind its bracket
    json_writer beats{p.beats};
    for (const auto& item : items) {
        const auto peers_before = p.peers.size();
        const auto beats_before = p.beats.size();
        const bool first = &item == &items.front();
        if (item.what == news_item::kind::beat) {
            write_beat(beats, item, now);
        } else {
            write_entry(peers, item, now, most_endpoints);
        }
        if (p.size() > longest && !first) {
            p.peers.resize(peers_before);
            p.beats.resize(beats_before);
            p.more = true;
            break;
        }
        if (p.size() > longest && item.what == news_item::kind::description) {
            // Not even one has room: it goes without some of its endpoints.
            for (auto count = item.endpoints->size(); p.size() > longest && count-- > 0;) {
                p.peers.resize(peers_before);
                write_entry(peers, item, now, count);
            }
        }
        p.next = item.news;
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
    out = milliseconds{std::min<std::uint64_t>(ms, static_cast<std::uint64_t>(longest_age.count()))};
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
            return read_state(r, out.said.leaving);
        }
        if (key == "leaving") {
            return r.skip();
        }
        out.has_interval |= key == "interval_ms";
        return read_announcement_member(r, key, out.said);
    });
    return good && has_epoch && protocol::is_name(out.said.node) && !protocol::is_reserved_target(out.said.node);
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

bool read_beat(json_reader& r, peer_beat& out) {
    constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
    std::uint64_t age = 0;
    std::uint64_t interval = 0;
    std::uint64_t queued = 0;
    std::uint64_t running = 0;
    if (!r.begin_array() || !read_number(r, out.seq) || !read_number(r, age) || !read_number(r, interval) ||
        !read_number(r, queued) || !read_number(r, running)) {
        return false;
    }
    while (r.next_element()) { // of later versions
        r.skip();
    }
    out.age = milliseconds{std::min<std::uint64_t>(age, static_cast<std::uint64_t>(longest_age.count()))};
    out.interval = std::clamp(
        milliseconds{std::min<std::uint64_t>(interval, static_cast<std::uint64_t>(longest_interval.count()))},
        shortest_interval, longest_interval);
    out.queued = static_cast<std::uint32_t>(std::min(queued, most));
    out.running = static_cast<std::uint32_t>(std::min(running, most));
    return r.ok();
}

bool read_beats(json_reader& r, std::size_t most, table_reader& to) {
    return read_members(r, [&](std::string_view key) {
        peer_beat beat;
        const auto epoch = protocol::parse_epoch(key);
        if (!epoch || most == 0) {
            return r.skip();
        }
        --most;
        beat.epoch = *epoch;
        if (!read_beat(r, beat)) {
            return false;
        }
        to.on_beat(beat);
        return true;
    });
}

} // namespace

void write_news(json_writer& w, const table_owner& who, const presence& others, const table_question& asked,
                std::size_t longest, time_point now) {
    std::uint64_t told = 0;
    if (asked.since.size() > 9 && asked.since.starts_with(who.epoch) && asked.since[8] == '.') {
        told = protocol::parse_number(asked.since.substr(9)).value_or(0);
    }
    if (told > others.latest_news()) {
        told = 0;
    }
    auto items = others.news_since(told, now);
    describe(items, others, asked.describe, told);
    const auto room = std::min(longest, table_page);
    const auto p = page_of(items, others.latest_news(), room > room_for_head ? room - room_for_head : 0, now);
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
                most_endpoints);
    w.end_array();
    w.end_object();
}

bool read_table(std::string_view json, std::size_t most_entries, table_reader& to, table_head& head) {
    head = {};
    json_reader r{json, table_depth};
    bool has_peers = false;
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "peers") {
            has_peers = true;
            return read_entries(r, most_entries, to);
        }
        if (key == "beats") {
            return read_beats(r, most_entries, to);
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
        return key == "node" || key == "endpoints" || key == "pool" ? read_announcement_member(r, key, out.said)
                                                                    : r.skip();
    });
    return good && has_epoch && protocol::is_name(out.said.node) && !protocol::is_reserved_target(out.said.node);
}

} // namespace cles::core
