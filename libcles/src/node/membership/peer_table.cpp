// SPDX-License-Identifier: BSL-1.0
#include "node/membership/peer_table.hpp"

#include <cles/url.hpp>

#include "json/json_members.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "protocol/grammar.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

namespace cles::core {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t table_depth = 8;
constexpr milliseconds max_age = std::chrono::hours{24};
constexpr std::size_t bytes_for_head = 256; // for the other members of the table, and the head of the reply

std::int64_t age_of(time_point last_seen, time_point now) {
    return std::max<std::int64_t>(0, std::chrono::ceil<milliseconds>(now - last_seen).count());
}

void write_signed_entry(json_writer& w, const delta_entry& item, time_point now) {
    const bool left = item.what == delta_entry::kind::leave || (item.announced != nullptr && item.announced->leaving);
    w.begin_object();
    write_signed_members(w, *item.original, item.seq, protocol::epoch_text(item.epoch));
    write_member(w, "age_ms", age_of(item.last_seen, now));
    write_member(w, "state", left ? "left" : to_string(item.state));
    w.end_object();
}

// Few nodes have an address that not everybody can use: only their lists are copied.
void write_endpoints_on_link(json_writer& w, const std::vector<std::string>& all, std::string_view zone,
                             std::size_t most) {
    const auto has_zone = [](const std::string& each) { return each.find('%') != std::string::npos; };
    if (std::ranges::any_of(all, has_zone)) {
        write_endpoints_member(w, endpoints_on_link(all, zone), most);
    } else {
        write_endpoints_member(w, all, most);
    }
}

// Another node that has left is only named.
void write_entry(json_writer& w, const delta_entry& item, time_point now, std::size_t endpoints,
                 std::string_view zone) {
    if (item.original != nullptr) {
        write_signed_entry(w, item, now);
        return;
    }
    const auto* const said = item.what == delta_entry::kind::leave ? nullptr : item.announced;
    const bool left = said == nullptr || said->leaving;
    w.begin_object();
    write_member(w, "node", item.node);
    if (said != nullptr) {
        if (!said->pool.empty()) {
            write_member(w, "pool", said->pool);
        }
        write_endpoints_on_link(w, *item.endpoints, zone, endpoints);
    }
    write_member(w, "epoch", protocol::epoch_text(item.epoch));
    if (item.seq != 0) {
        write_member(w, "seq", item.seq);
    }
    write_member(w, "age_ms", age_of(item.last_seen, now));
    if (said != nullptr) {
        write_member(w, "interval_ms", said->interval.count());
    }
    write_member(w, "state", left ? "left" : to_string(item.state));
    if (said != nullptr) {
        write_load_member(w, said->load);
        write_member(w, "tasks", said->tasks);
        write_list_member(w, "signed", said->signed_tasks);
        write_list_member(w, "links", said->links);
    }
    w.end_object();
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
    std::string routes = "{";
    std::uint64_t next = 0;
    bool more = false;

    [[nodiscard]] std::size_t size() const noexcept { return peers.size() + beats.size() + routes.size(); }
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

void write_route(json_writer& w, std::uint32_t epoch, const route_advert& how) {
    w.plain_key(protocol::epoch_text(epoch));
    w.begin_array();
    w.value(how.seq);
    if (how.hops) {
        w.value(std::uint64_t{*how.hops});
    }
    w.end_array();
}

page page_of(const std::vector<delta_entry>& items, std::uint64_t latest, std::size_t longest,
             const route_function& route_of, std::string_view zone, time_point now) {
    page p;
    json_writer peers{p.peers}; // both write after the opening bracket
    json_writer beats{p.beats};
    json_writer routes{p.routes};
    for (const auto& item : items) {
        const auto peers_before = p.peers.size();
        const auto beats_before = p.beats.size();
        const auto routes_before = p.routes.size();
        const bool first = &item == &items.front();
        if (item.what == delta_entry::kind::heartbeat) {
            write_heartbeat(beats, item, now);
        } else {
            write_entry(peers, item, now, max_endpoints, zone);
        }
        if (const auto route = route_of ? route_of(item) : std::nullopt) {
            write_route(routes, item.epoch, *route);
        }
        if (p.size() > longest && !first) {
            p.peers.resize(peers_before);
            p.beats.resize(beats_before);
            p.routes.resize(routes_before);
            p.more = true;
            break;
        }
        if (p.size() > longest && item.original != nullptr) { // it cannot be shortened
            p.peers.resize(peers_before);
        } else if (p.size() > longest && item.what == delta_entry::kind::description) {
            // Not even one entry fits: it is written with fewer endpoints.
            for (auto count = item.endpoints->size(); p.size() > longest && count-- > 0;) {
                p.peers.resize(peers_before);
                write_entry(peers, item, now, count, zone);
            }
        }
        p.next = item.revision;
    }
    if (!p.more) {
        p.next = latest;
    }
    p.peers.push_back(']');
    p.beats.push_back('}');
    p.routes.push_back('}');
    return p;
}

bool is_of_a_node(const peer_report& report) noexcept {
    return protocol::is_name(report.announced.node) && !protocol::is_reserved_target(report.announced.node);
}

bool read_entry(std::string_view json, peer_report& out) {
    std::optional<std::uint32_t> epoch;
    json_reader r{json, table_depth};
    const bool good = read_members(r, [&](std::string_view key) {
        if (key == "state") {
            std::string_view state;
            const bool is_text = r.read(state);
            out.announced.leaving = state == "left";
            return is_text;
        }
        return key == "epoch"     ? read_epoch(r, epoch)
               : key == "seq"     ? r.read(out.seq)
               : key == "age_ms"  ? read_milliseconds(r, out.age, max_age)
               : key == "leaving" ? r.skip()
                                  : read_announcement_member(r, key, out.announced);
    });
    out.epoch = epoch.value_or(0);
    return good && epoch && is_of_a_node(out);
}

// Signed announcements are passed on unchanged. So an unspecified address or Unix socket in one means nothing, and a
// loopback address may be that of another host.
void keep_endpoints_for_others(std::vector<std::string>& endpoints) {
    std::erase_if(endpoints, [](std::string_view url) {
        return stays_on_host(url.substr(0, url.find(':'))) || url.find("://0.0.0.0:") != std::string_view::npos ||
               url.find("://[::]:") != std::string_view::npos;
    });
    std::stable_partition(endpoints.begin(), endpoints.end(), [](std::string_view url) {
        return url.find("://127.") == std::string_view::npos && url.find("://[::1]:") == std::string_view::npos;
    });
}

// Beside the announcement, only its age counts.
bool read_signed_entry(std::string_view json, peer_report& out) {
    signed_entry entry;
    json_reader r{json, table_depth + 1};
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "age_ms" ? read_milliseconds(r, out.age, max_age) : read_signed_member(r, key, entry);
    });
    if (!good || !entry.epoch || entry.seq == 0 || entry.sig.empty() || entry.body.size() > protocol::datagram_bytes ||
        !read_announcement(entry.body, out.announced) || !is_of_a_node(out)) {
        return false;
    }
    out.epoch = *entry.epoch;
    out.seq = entry.seq;
    keep_endpoints_for_others(out.announced.endpoints);
    out.announced.original =
        std::make_shared<signed_announcement>(signed_announcement{std::string{entry.body}, std::move(entry.sig)});
    return true;
}

bool read_entries(json_reader& r, std::size_t most, std::chrono::milliseconds usual, entry_form form, peer_table& out) {
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        std::string_view text;
        if (!r.read_raw(text)) {
            return false;
        }
        if (most == 0) {
            continue;
        }
        --most;
        peer_report report;
        report.announced.interval = usual;
        if (form == entry_form::plain ? read_entry(text, report) : read_signed_entry(text, report)) {
            out.reports.push_back(std::move(report));
        } else {
            ++out.bad_entries;
        }
    }
    return r.ok();
}

bool read_heartbeat(json_reader& r, peer_heartbeat& out) {
    if (!r.begin_array() || !r.next_element() || !r.read(out.seq) || !r.next_element() ||
        !read_milliseconds(r, out.age, max_age) || !r.next_element() || !read_interval(r, out.interval) ||
        !r.next_element() || !read_count(r, out.queued) || !r.next_element() || !read_count(r, out.running)) {
        return false;
    }
    while (r.next_element()) { // values of later versions
        r.skip();
    }
    return r.ok();
}

bool read_heartbeats(json_reader& r, std::size_t most, peer_table& out) {
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
        out.beats.push_back(beat);
        return true;
    });
}

void write_owner(json_writer& w, const table_owner& who, std::string_view pool) {
    write_member(w, "node", who.node);
    write_member(w, "epoch", who.epoch);
    if (!pool.empty()) {
        write_member(w, "pool", pool);
    }
}

bool read_route(json_reader& r, route_advert& out) {
    if (!r.begin_array() || !r.next_element() || !r.read(out.seq)) {
        return false;
    }
    if (r.next_element()) {
        std::uint32_t hops = 0;
        if (!read_count(r, hops)) {
            return false;
        }
        out.hops = hops;
        while (r.next_element()) { // values of later versions
            r.skip();
        }
    }
    return r.ok();
}

bool read_routes(json_reader& r, std::size_t most, std::vector<peer_table::route>& out) {
    return read_members(r, [&](std::string_view key) {
        const auto epoch = protocol::parse_epoch(key);
        if (!epoch || most == 0) {
            return r.skip();
        }
        --most;
        peer_table::route found{.epoch = *epoch, .advert = {}};
        if (!read_route(r, found.advert)) {
            return false;
        }
        out.push_back(found);
        return true;
    });
}

} // namespace

void write_delta(json_writer& w, const table_owner& who, const membership& others, const table_question& asked,
                 std::size_t longest, time_point now, const route_function& route_of) {
    std::uint64_t sent = 0;
    if (asked.since.size() > 9 && asked.since.starts_with(who.epoch) && asked.since[8] == '.') {
        sent = protocol::parse_number(asked.since.substr(9)).value_or(0);
    }
    if (sent > others.latest_revision()) {
        sent = 0;
    }
    auto items = others.deltas_since(sent, now);
    describe(items, others, asked.describe, sent);
    const auto available = std::min(longest, table_page);
    const auto for_items = available > bytes_for_head ? available - bytes_for_head : 0;
    const auto p = page_of(items, others.latest_revision(), for_items, route_of, asked.zone, now);
    w.begin_object();
    write_owner(w, who, others.pool());
    w.plain_key("peers");
    w.raw(p.peers);
    w.plain_key("beats");
    w.raw(p.beats);
    if (route_of) {
        w.plain_key("routes");
        w.raw(p.routes);
    }
    write_member(w, "next", std::string{who.epoch} + "." + std::to_string(p.next));
    if (p.more) {
        write_member(w, "more", true);
    }
    w.end_object();
}

void write_own_entry(json_writer& w, const incarnation& own, time_point now) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    write_entry(w, delta_entry::of(delta_entry::kind::description, own.announced.node, own, peer_state::live), now,
                max_endpoints, {});
    w.end_array();
    w.end_object();
}

void write_routes(json_writer& w, const table_owner& who, std::string_view pool,
                  const std::vector<peer_table::route>& routes, const std::vector<peer_table::route>& wanted) {
    w.begin_object();
    write_owner(w, who, pool);
    w.plain_key("peers");
    w.raw("[]");
    for (const auto* const part : {&routes, &wanted}) {
        if (part->empty()) {
            continue;
        }
        w.plain_key(part == &routes ? "routes" : "wanted");
        w.begin_object();
        for (const auto& [epoch, advert] : *part) {
            write_route(w, epoch, advert);
        }
        w.end_object();
    }
    w.end_object();
}

bool read_table(std::string_view json, std::size_t max_entries, std::chrono::milliseconds usual, peer_table& out,
                entry_form form) {
    out = {};
    json_reader r{json, table_depth + (form == entry_form::plain ? 0U : 3U)};
    bool has_peers = false;
    const bool good = read_members(r, [&](std::string_view key) {
        has_peers = has_peers || key == "peers";
        return key == "peers"    ? read_entries(r, max_entries, usual, form, out)
               : key == "beats"  ? read_heartbeats(r, max_entries, out)
               : key == "routes" ? read_routes(r, max_entries, out.routes)
               : key == "wanted" ? read_routes(r, max_entries, out.wanted)
               : key == "node"   ? r.read(out.node)
               : key == "epoch"  ? r.read(out.epoch)
               : key == "pool"   ? r.read(out.pool)
               : key == "next"   ? r.read(out.next)
               : key == "more"   ? r.read(out.more)
                                 : r.skip();
    });
    return good && has_peers;
}

bool read_description(std::string_view json, std::chrono::milliseconds usual, peer_report& out) {
    out = {};
    out.announced.interval = usual;
    std::optional<std::uint32_t> epoch;
    json_reader r{json};
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "epoch"                                         ? read_epoch(r, epoch)
               : key == "node" || key == "endpoints" || key == "pool" ? read_announcement_member(r, key, out.announced)
                                                                      : r.skip();
    });
    out.epoch = epoch.value_or(0);
    return good && epoch && is_of_a_node(out);
}

void write_peers(json_writer& w, const std::vector<peer>& all, std::string_view pool) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    for (const auto& p : all) {
        w.begin_object();
        write_member(w, "node", p.node);
        if (!pool.empty()) {
            write_member(w, "pool", pool);
        }
        write_endpoints_member(w, p.endpoints, p.endpoints.size());
        write_member(w, "epoch", p.epoch);
        write_member(w, "age_ms", p.age.count());
        write_member(w, "state", to_string(p.state));
        write_load_member(w, p.load);
        if (p.hops != 1) {
            write_member(w, "hops", std::uint64_t{p.hops});
            write_member(w, "via", p.via);
        }
        w.end_object();
    }
    w.end_array();
    w.end_object();
}

} // namespace cles::core
