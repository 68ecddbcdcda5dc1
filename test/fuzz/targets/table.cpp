// SPDX-License-Identifier: BSL-1.0
// Tables of nodes from other nodes, one a line: what is accepted stays within its limits, what is sent in turn can be
// read, and a node that repeatedly asks for changes finally receives everything.

#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "protocol/grammar.hpp"

#include <chrono>
#include <string>

namespace cles::fuzz {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t most_peers = 4;

// Reads a table and applies it to `table`. Returns false if it is not valid.
bool learn(core::membership& table, std::string_view text, std::size_t most, time_point now, core::peer_table& read) {
    const bool good = core::read_table(text, most, core::usual_interval, read);
    for (const auto& r : read.reports) {
        require(protocol::is_name(r.announced.node) && !protocol::is_reserved_target(r.announced.node),
                "a node has a name");
        require(r.announced.endpoints.size() <= core::max_endpoints, "endpoints are bounded");
        require(r.age >= milliseconds{0} && r.age <= std::chrono::hours{24}, "an age is bounded");
        require(r.announced.interval >= core::min_interval && r.announced.interval <= core::max_interval,
                "an interval is bounded");
        table.apply_gossip(r, core::observed_source::at("tcp://10.0.0.7:1"), now, now);
    }
    for (const auto& b : read.beats) {
        table.apply_gossip(b, now, now);
    }
    return good;
}

// For another node that asks this one until there is nothing more.
void check_told(const core::membership& table, time_point now) {
    core::deadline_queue deadlines;
    core::membership other{"other", 2, deadlines, most_peers * 2};
    std::string since = "0";
    for (int i = 0;; ++i) {
        require(i < 64, "there is an end");
        std::string text;
        json_writer w{text};
        write_delta(w, {"me", "00000001"}, table, {since, i % 2 == 0 ? "" : "00000002,00000003"}, 1200, now);
        require(text.size() <= 1200, "an answer fits a datagram", text);
        require(is_valid_json(text), "an answer is JSON", text);
        core::peer_table read;
        require(learn(other, text, 64, now, read), "an answer can be read", text);
        require(!read.next.empty(), "an answer says what to ask with next", text);
        since = read.next;
        if (!read.more) {
            break;
        }
    }
    table.for_each([&](const core::membership::member& k) {
        require(k.suspect || k.node == "other" || other.find_member(k.node).has_value(), "who is live is told of",
                k.node);
    });
}

} // namespace

void run(std::string_view input) {
    core::deadline_queue deadlines;
    core::membership table{"me", 1, deadlines, most_peers};
    time_point now{std::chrono::hours{1}};
    table.announce_self({.node = "me", .endpoints = {"tcp://0.0.0.0:1"}}, 1, now);
    while (!input.empty()) {
        const auto end = input.find('\n');
        const auto line = input.substr(0, end);
        input.remove_prefix(end == std::string_view::npos ? input.size() : end + 1);
        now += milliseconds{static_cast<int>(line.size()) * 3};
        deadlines.expire(now);
        core::peer_table read;
        learn(table, line, 8, now, read);
        require(read.reports.size() + read.beats.size() + read.bad_entries <= 16, "only so many entries count", line);
        require(table.size() <= most_peers, "the table is bounded", line);
        check_told(table, now);
        core::peer_report ignored;
        core::read_description(line, core::usual_interval, ignored);
    }
    now += std::chrono::hours{48};
    deadlines.expire(now);
    require(table.size() == 0 && !deadlines.next(), "who is silent is forgotten, and nothing waits for him");
}

} // namespace cles::fuzz
