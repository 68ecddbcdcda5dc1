// SPDX-License-Identifier: BSL-1.0
// A request line: what is read is what is written, for any content.
#include "protocol/request_line.hpp"

#include "fuzz/fuzz.hpp"
#include "protocol/grammar.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"

#include <string>
#include <string_view>

namespace cles::fuzz {
namespace {

namespace p = protocol;

void check_noun(const p::noun_view& noun) {
    require(p::is_name(noun.target) && p::is_name(noun.task), "target and task are names", noun.path);
    for (const auto parameter : noun.parameters) {
        require(p::is_parameter(parameter), "a parameter that was read is one", parameter);
        std::string decoded;
        p::decode_parameter(parameter, decoded);
        std::string encoded;
        p::encode_parameter(decoded, encoded);
        std::string again;
        p::decode_parameter(encoded, again);
        require(p::is_parameter(encoded) && again == decoded, "a parameter comes back decoded", parameter);
    }
    std::string scratch;
    const std::string canonical{p::canonical_path(noun, scratch)};
    p::noun_view same;
    std::string why;
    const auto whole = std::string{noun.target} + ":" + canonical;
    require(p::parse_noun(whole, same, why), "a canonical path is a path", canonical);
    std::string second;
    require(p::canonical_path(same, second) == canonical, "a canonical path is canonical", canonical);
    require(same.parameters.size() == noun.parameters.size(), "it has as many parameters", canonical);
}

/// The adverbs that are no members of `outgoing_request`.
std::string further_adverbs(const p::request_line& r) {
    std::string all;
    const auto add = [&all](std::string_view key, std::string_view value) {
        if (!value.empty()) {
            all.append(all.empty() ? "" : " ").append(key).append("=").append(value);
        }
    };
    add("via", r.via);
    add("from", r.from);
    add("sig", r.sig);
    add("since", r.since);
    add("describe", r.describe);
    if (r.routes.distance != 0) {
        add("routes", std::to_string(r.routes.distance).append(".").append(r.routes.by));
    }
    if (r.grant != 0) {
        add("grant", p::grant_text(r.grant));
    }
    if (r.is_update()) {
        add("seq", std::to_string(*r.seq));
        add("epoch", p::epoch_text(*r.epoch));
    }
    return all;
}

std::string written(const p::request_line& r) {
    const auto path = std::string{r.noun.target}.append(":").append(r.noun.path);
    const auto further = further_adverbs(r);
    p::outgoing_request out;
    // All members, so that a new one does not compile until it is set here.
    auto& [verb, noun, id, deadline_ms, wants_reply, wants_progress, carried, lease_ms, every_ms, keep, hops,
           wants_mark, adverbs, body] = out;
    verb = r.verb;
    noun = path;
    id = r.id;
    deadline_ms = r.deadline_ms;
    wants_reply = r.wants_reply;
    wants_progress = r.wants_progress;
    carried = r.carried();
    lease_ms = r.lease_ms;
    every_ms = r.every_ms;
    keep = r.keep;
    hops = r.hops;
    wants_mark = r.wants_mark;
    adverbs = further;
    body = r.body;
    std::string text;
    p::append_request(text, out);
    return text;
}

template <class F>
void for_each_known_adverb(std::string_view line, cles::verb verb, F each) {
    p::part_reader parts{line};
    parts.next(); // verb
    parts.next(); // noun
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        if (p::adverb found; p::split_adverb(part, found) && p::is_known_adverb(found.key, verb)) {
            each(found.key);
        }
    }
}

/// Each adverb of the line is also in what was written, unless that means the same without it. So one of which
/// `written` and `append_request` know nothing is noticed.
void check_complete(const p::request_line& r, std::string_view line, std::string_view text) {
    for_each_known_adverb(line, r.verb, [&](std::string_view key) {
        bool found = (key == "hops" && r.hops == p::default_hops) || (key == "trace" && !r.trace);
        for_each_known_adverb(text, r.verb, [&](std::string_view other) { found = found || other == key; });
        require(found, "an adverb is written", text);
    });
}

/// A line may end with CR and SP, which are not part of it, and as white space of JSON they may also end a body.
std::string_view without_trailing_space(std::string_view body) {
    return body.substr(0, body.find_last_not_of(" \r") + 1);
}

void check_same(const p::request_line& a, const p::request_line& b, std::string_view line) {
    require(a.verb == b.verb && a.noun.target == b.noun.target && a.noun.path == b.noun.path, "verb and noun stay",
            line);
    require(a.id == b.id && a.deadline_ms == b.deadline_ms && a.hops == b.hops && a.via == b.via, "adverbs stay", line);
    require(a.from == b.from && a.sig == b.sig, "requester and signature stay", line);
    require(a.since == b.since && a.describe == b.describe && a.routes.distance == b.routes.distance &&
                a.routes.by == b.routes.by,
            "questions stay", line);
    require(a.grant == b.grant, "a grant stays", line);
    require(a.wants_reply == b.wants_reply && a.wants_progress == b.wants_progress && a.wants_mark == b.wants_mark,
            "wishes stay", line);
    require(a.carried() == b.carried(), "what is carried stays", line);
    require(a.lease_ms == b.lease_ms && a.every_ms == b.every_ms && a.keep == b.keep, "terms of a BIND stay", line);
    require(a.seq == b.seq && a.epoch == b.epoch, "an update stays", line);
    require(without_trailing_space(a.body) == without_trailing_space(b.body), "a body stays", line);
}

void check_bounds(const p::request_line& r, std::string_view line) {
    require(r.id <= p::max_id && r.hops <= p::max_hops, "id and hops are within their bounds", line);
    require(r.deadline_ms >= 1 && r.deadline_ms <= p::max_deadline_ms, "the deadline is within its bounds", line);
    require(r.every_ms <= p::max_deadline_ms, "every is within its bounds", line);
    require(r.keep >= 1 && r.keep <= p::max_keep, "keep is within its bounds", line);
    require(!r.lease_ms || *r.lease_ms <= p::max_lease_ms, "the lease is within its bounds", line);
    require(r.body.empty() || r.body.front() == '{' || r.body.front() == '[', "a body begins with a bracket", line);
}

} // namespace

void run(std::string_view input) {
    const auto line = p::trim(input.substr(0, input.find('\n')));
    p::is_http(line);
    if (line.empty() || p::is_reply(line)) {
        return;
    }
    p::request_line request;
    p::malformed_request malformed;
    const auto meant = p::salvage(line);
    if (!p::parse_request(line, request, malformed)) {
        require(!malformed.why.empty(), "a mistake has a name", line);
        require(malformed.id == meant.id && malformed.wants_reply == meant.wants_reply, "what can be known is known",
                line);
        return;
    }
    require(meant.id == request.id, "a valid line's id is known from its beginning", line);
    require(request.is_update() ? !meant.wants_reply : meant.wants_reply == request.wants_reply,
            "whether an answer is wanted is known from a line's beginning", line);
    check_noun(request.noun);
    check_bounds(request, line);

    const auto text = written(request);
    const auto again = p::trim(std::string_view{text}.substr(0, text.size() - 1));
    p::request_line second;
    require(p::parse_request(again, second, malformed), "what is written can be read", text);
    // Adverbs that do not apply to these verbs are not read, so they are not written for others.
    check_same(request, second, line);
    check_complete(request, line, again);
}

} // namespace cles::fuzz
