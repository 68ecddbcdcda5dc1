// SPDX-License-Identifier: BSL-1.0
// Announcements of nodes, one a line: parsed values stay within their limits, and what is written is what was read. The
// table of nodes receives them from two sources, with time passing.

#include "node/membership/announcement.hpp"

#include <cles/json_reader.hpp>
#include <cles/url.hpp>

#include "fuzz/fuzz.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <string>

namespace cles::fuzz {
namespace {

constexpr std::size_t most_peers = 4;

void check_bounds(const core::announcement& said, std::string_view line) {
    require(protocol::is_name(said.node) && !protocol::is_reserved_target(said.node), "a node has a name", line);
    require(said.endpoints.size() <= core::max_endpoints, "endpoints are bounded", line);
    for (const auto& endpoint : said.endpoints) {
        require(!endpoint.empty() && endpoint.size() <= core::max_endpoint, "an endpoint is bounded", line);
    }
    require(said.interval >= core::min_interval && said.interval <= core::max_interval,
            "the interval is within its bounds", line);
    require(said.tasks.size() <= core::max_digest, "the digest is bounded", line);
}

void check_written(const core::announcement& said, const protocol::request_line& update, std::string_view line) {
    std::string text;
    append_announcement(text, said, *update.seq, protocol::epoch_text(*update.epoch));
    require(text.size() <= protocol::datagram_bytes, "what is written fits a datagram", text);
    text.pop_back();
    protocol::request_line again;
    protocol::malformed_request wrong;
    require(protocol::parse_request(text, again, wrong), "what is written is a request", text);
    core::announcement second;
    std::string why;
    require(read_announcement(again, second, why), "what is written can be read", text);
    require(second.node == said.node && second.load == said.load && second.interval == said.interval &&
                second.leaving == said.leaving,
            "what is written stays the same", line);
    require(second.endpoints.size() <= said.endpoints.size(), "no endpoint is added", line);
}

void check_reachable(const core::announcement& said, const core::group_source& from) {
    for (const auto& endpoint : core::reachable_endpoints(said.endpoints, core::observed_source::of(from))) {
        const auto where = parse_url(endpoint); // throws if it is not a URL
        require(where.scheme != "inproc", "nobody is sent into another process", endpoint);
        require(from.is_loopback() ||
                    (where.scheme != "unix" && !where.host.starts_with("127.") && where.host != "::1"),
                "another host does not send anybody to this one", endpoint);
    }
}

} // namespace

void run(std::string_view input) {
    core::deadline_queue deadlines;
    core::membership table{"me", 1, deadlines, most_peers};
    time_point now{std::chrono::hours{1}};
    for (unsigned n = 0; !input.empty(); ++n) {
        const auto end = input.find('\n');
        const auto line = protocol::trim(input.substr(0, end));
        input.remove_prefix(end == std::string_view::npos ? input.size() : end + 1);
        now += std::chrono::milliseconds{static_cast<int>(line.size()) * 7};
        deadlines.expire(now);
        protocol::request_line update;
        protocol::malformed_request wrong;
        core::announcement said;
        std::string why;
        if (!protocol::parse_request(line, update, wrong)) {
            continue;
        }
        if (!read_announcement(update, said, why)) {
            require(!why.empty(), "a mistake has a name", line);
            continue;
        }
        check_bounds(said, line);
        check_written(said, update, line);
        const core::group_source from =
            n % 3 == 0 ? core::group_source{0x7F000001, 4} : core::group_source{0x0A000007, 5};
        check_reachable(said, from);
        table.apply_announcement(said, *update.epoch, *update.seq, from, now);
        require(table.size() <= most_peers, "the table is bounded", line);
        std::string json;
        json_writer w{json};
        core::write_peers(w, table.list(now), {});
        require(is_valid_json(json), "the list of nodes is JSON", json);
    }
    deadlines.expire(now + std::chrono::hours{1});
    require(table.size() == 0 && !deadlines.next(), "who is silent is forgotten, and nothing waits for him");
}

} // namespace cles::fuzz
