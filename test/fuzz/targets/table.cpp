// SPDX-License-Identifier: BSL-1.0
// Tables of nodes from other nodes, one a line: what is accepted stays within its limits, what is sent in turn can be
// read, and a node that repeatedly asks for changes finally receives everything. If the first line is "signed", they
// are those of a secured fleet; whether signatures are valid is not part of this.

#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "protocol/grammar.hpp"

#include <chrono>
#include <memory>
#include <string>

namespace cles::fuzz {
namespace {

using std::chrono::milliseconds;

using core::entry_form;

constexpr std::size_t most_peers = 4;

// Reads a table and applies it to `table`. Returns false if it is not valid.
bool learn(core::membership& table, std::string_view text, std::size_t most, entry_form form, time_point now,
           core::peer_table& read) {
    const bool good = core::read_table(text, most, core::usual_interval, read, form);
    for (const auto& r : read.reports) {
        require((r.announced.original != nullptr) == (form == entry_form::signed_by_node), "entries have one form");
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
void check_told(const core::membership& table, entry_form form, time_point now) {
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
        require(learn(other, text, 64, form, now, read), "an answer can be read", text);
        require(!read.next.empty(), "an answer says what to ask with next", text);
        since = read.next;
        if (!read.more) {
            break;
        }
    }
    table.for_each([&](const core::membership::member& k) { // a signed entry may be too large for a datagram
        require(form == entry_form::signed_by_node || k.suspect || k.node == "other" ||
                    other.find_member(k.node).has_value(),
                "who is live is told of", k.node);
    });
}

} // namespace

void run(std::string_view input) {
    core::deadline_queue deadlines;
    core::membership table{"me", 1, deadlines, most_peers};
    time_point now{std::chrono::hours{1}};
    constexpr std::string_view mark = "signed\n";
    const auto form = input.starts_with(mark) ? entry_form::signed_by_node : entry_form::plain;
    core::announcement own{.node = "me", .endpoints = {"tcp://0.0.0.0:1"}};
    if (form == entry_form::signed_by_node) {
        input.remove_prefix(mark.size());
        own.original = std::make_shared<core::signed_announcement>(
            core::signed_announcement{R"({"node":"me","endpoints":["tls://10.0.0.1:1"]})", "x"});
    }
    table.announce_self(own, 1, now);
    while (!input.empty()) {
        const auto end = input.find('\n');
        const auto line = input.substr(0, end);
        input.remove_prefix(end == std::string_view::npos ? input.size() : end + 1);
        now += milliseconds{static_cast<int>(line.size()) * 3};
        deadlines.expire(now);
        core::peer_table read;
        learn(table, line, 8, form, now, read);
        require(read.reports.size() + read.beats.size() + read.bad_entries <= 16, "only so many entries count", line);
        require(table.size() <= most_peers, "the table is bounded", line);
        check_told(table, form, now);
        core::peer_report ignored;
        core::read_description(line, core::usual_interval, ignored);
    }
    now += std::chrono::hours{48};
    deadlines.expire(now);
    require(table.size() == 0 && !deadlines.next(), "who is silent is forgotten, and nothing waits for him");
}

} // namespace cles::fuzz
