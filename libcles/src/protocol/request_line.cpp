// SPDX-License-Identifier: BSL-1.0
#include "protocol/request_line.hpp"

#include "json/json_scan.hpp"
#include "protocol/hex_number.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>
#include <array>

namespace cles::protocol {
namespace {

template <class F>
bool is_list(std::string_view text, F is_element) {
    for (;;) {
        const auto comma = text.find(',');
        if (!is_element(text.substr(0, comma))) {
            return false;
        }
        if (comma == std::string_view::npos) {
            return true;
        }
        text.remove_prefix(comma + 1);
    }
}

bool is_epoch_list(std::string_view text) {
    constexpr std::size_t each = 9; // including its comma
    return text.size() < max_described * each && is_list(text, [](auto part) { return parse_epoch(part).has_value(); });
}

/// Assigns the value if there is one; returns whether there is.
template <class Target>
bool take(Target& target, std::optional<std::uint64_t> value) {
    if (value) {
        target = static_cast<Target>(*value);
    }
    return value.has_value();
}

/// Sets the flag if the adverb has the only value that it may have; returns whether it has.
bool take_flag(bool& flag, bool meaning, bool given) noexcept {
    flag = given ? meaning : flag;
    return given;
}

std::optional<std::uint64_t> lease_from(std::string_view value) noexcept {
    if (const auto lease = parse_number(value)) {
        return std::min<std::uint64_t>(*lease, max_lease_ms);
    }
    return is_number(value) ? std::optional<std::uint64_t>{max_lease_ms} : std::nullopt; // too long for 64 bits
}

bool take_routes(routes_question& target, std::string_view text) {
    const auto dot = text.find('.');
    target.by = text.substr(dot == std::string_view::npos ? text.size() : dot + 1);
    return dot < 3 && take(target.distance, number_between(text.substr(0, dot), 1, max_hops)) && is_name(target.by);
}

// Whatever it is, it does not make the request invalid. The first valid one counts.
bool take_trace(std::string_view text, request_line& r) {
    if (!r.trace) {
        r.trace = parse_traceparent(text).value_or(trace_context{});
    }
    return true;
}

template <class... Verbs>
constexpr unsigned on(Verbs... verbs) {
    return ((1U << static_cast<unsigned>(verbs)) | ...);
}

/// An adverb that this version defines.
struct known_adverb {
    std::string_view key;
    unsigned verbs;                                         ///< a bit for each on which it means something
    bool (*apply)(std::string_view value, request_line& r); ///< returns whether the value is valid
    /// Whether it is a member of `outgoing_request`, which `append_request` writes. The others are part of its
    /// `adverbs`.
    bool is_member = false;
};

constexpr auto on_all = on(verb::pull, verb::push, verb::delegate, verb::bind, verb::update);
constexpr std::array known_adverbs{
    known_adverb{"id", on_all,
                 [](std::string_view v, request_line& r) { return take(r.id, number_between(v, 1, max_id)); }, true},
    known_adverb{
        "deadline", on_all,
        [](std::string_view v, request_line& r) { return take(r.deadline_ms, number_between(v, 1, max_deadline_ms)); },
        true},
    known_adverb{"reply", on(verb::push, verb::update),
                 [](std::string_view v, request_line& r) { return take_flag(r.wants_reply, false, v == "no"); }, true},
    known_adverb{"progress", on(verb::delegate),
                 [](std::string_view v, request_line& r) { return take_flag(r.wants_progress, true, v == "yes"); },
                 true},
    known_adverb{"urgent", on(verb::pull, verb::push, verb::delegate),
                 [](std::string_view v, request_line& r) { return take_flag(r.urgent, true, v == "yes"); }, true},
    known_adverb{"trace", on_all, take_trace, true},
    known_adverb{"lease", on(verb::bind),
                 [](std::string_view v, request_line& r) { return take(r.lease_ms, lease_from(v)); }, true},
    known_adverb{
        "every", on(verb::bind),
        [](std::string_view v, request_line& r) { return take(r.every_ms, number_between(v, 1, max_deadline_ms)); },
        true},
    known_adverb{"keep", on(verb::bind),
                 [](std::string_view v, request_line& r) { return take(r.keep, number_between(v, 1, max_keep)); },
                 true},
    known_adverb{"hops", on_all,
                 [](std::string_view v, request_line& r) { return take(r.hops, number_between(v, 0, max_hops)); },
                 true},
    known_adverb{"mark", on(verb::bind),
                 [](std::string_view v, request_line& r) { return take_flag(r.wants_mark, true, v == "yes"); }, true},
    known_adverb{"seq", on(verb::update),
                 [](std::string_view v, request_line& r) { return take(r.seq, number_between(v, 1, max_id)); }},
    known_adverb{"epoch", on(verb::update),
                 [](std::string_view v, request_line& r) { return (r.epoch = parse_epoch(v)).has_value(); }},
    known_adverb{"via", on_all, [](std::string_view v, request_line& r) { return is_list(r.via = v, is_name); }},
    known_adverb{"from", on_all, [](std::string_view v, request_line& r) { return is_name(r.from = v); }},
    known_adverb{"sig", on_all, [](std::string_view v, request_line& r) { return (r.sig = v).size() <= max_sig; }},
    known_adverb{"since", on(verb::pull),
                 [](std::string_view v, request_line& r) { return (r.since = v).size() <= max_since; }},
    known_adverb{"describe", on(verb::pull),
                 [](std::string_view v, request_line& r) { return is_epoch_list(r.describe = v); }},
    known_adverb{"routes", on(verb::pull),
                 [](std::string_view v, request_line& r) { return take_routes(r.routes, v); }},
    known_adverb{"grant", on(verb::push, verb::delegate),
                 [](std::string_view v, request_line& r) { return take(r.grant, parse_grant(v)); }}};

/// Its index; past the end: it is not defined for that verb.
std::size_t find_known(std::string_view key, verb v) noexcept {
    for (std::size_t i = 0; i < known_adverbs.size(); ++i) {
        if (known_adverbs[i].key == key) {
            return (known_adverbs[i].verbs & on(v)) != 0 ? i : known_adverbs.size();
        }
    }
    return known_adverbs.size();
}

bool parse_adverbs(part_reader& parts, request_line& out, std::string& why) {
    std::uint32_t seen = 0;
    std::size_t count = 0;
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        adverb a;
        if (!split_adverb(part, a)) {
            why = quoted(part) + " is neither an adverb (key=value) nor a body ({ or [)";
            return false;
        }
        if (++count > max_adverbs) {
            why = "more than 16 adverbs";
            return false;
        }
        const auto known = find_known(a.key, out.verb);
        if (known == known_adverbs.size()) {
            if (a.key.starts_with("must_")) {
                why = "the adverb " + quoted(a.key) + " is not known here";
                return false;
            }
            ++out.unknown_adverbs;
            continue;
        }
        const auto bit = 1U << known;
        if ((seen & bit) != 0 && a.key != "trace") {
            why = "the adverb " + quoted(a.key) + " occurs twice";
            return false;
        }
        seen |= bit;
        if (!known_adverbs[known].apply(a.value, out)) {
            why = "the adverb '" + std::string{a.key} + "' has the bad value " + quoted(a.value);
            return false;
        }
    }
    return true;
}

bool parse_parts(std::string_view line, request_line& out, std::string& why) {
    out.text = line;
    part_reader parts{line};
    const auto verb_part = parts.next();
    const auto v = verb_from(verb_part);
    if (!v) {
        why = quoted(verb_part) + " is not a verb (PULL, PUSH, DELEGATE, BIND, UPDATE)";
        return false;
    }
    out.verb = *v;
    out.deadline_ms = default_deadline(*v);
    const auto noun = parts.next();
    if (noun.empty()) {
        why = std::string{to_string(*v)} + " without a noun (target:task)";
        return false;
    }
    if (!parse_noun(noun, out.noun, why) || !parse_adverbs(parts, out, why)) {
        return false;
    }
    out.body = parts.rest();
    if (!out.body.empty() && (*v == verb::pull || *v == verb::bind)) {
        why = std::string{to_string(*v)} + " takes no body";
        return false;
    }
    if (out.seq.has_value() != out.epoch.has_value()) {
        why = "an update needs both 'seq' and 'epoch', a request to publish neither";
        return false;
    }
    return true;
}

void append_adverb(std::string& out, std::string_view key, std::uint64_t value) {
    out.push_back(' ');
    out.append(key).push_back('=');
    append_number(out, value);
}

} // namespace

bool parse_request(std::string_view line, request_line& out, malformed_request& error) {
    if (parse_parts(line, out, error.why)) {
        return true;
    }
    auto why = std::move(error.why);
    error = salvage(line);
    error.why = std::move(why);
    return false;
}

bool parse_group_message(std::string_view datagram, request_line& out) {
    if (datagram.size() > datagram_bytes) {
        return false;
    }
    if (datagram.ends_with('\n')) {
        datagram.remove_suffix(1);
    }
    const auto line = trim(datagram);
    if (line.empty() || has_many_lines(line) || is_reply(line)) {
        return false;
    }
    malformed_request ignored;
    return parse_request(line, out, ignored);
}

bool is_known_adverb(std::string_view key, verb v) noexcept { return find_known(key, v) != known_adverbs.size(); }

std::size_t max_written_adverbs(verb v) noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(
        known_adverbs, [v](const known_adverb& each) { return each.is_member && (each.verbs & on(v)) != 0; }));
}

malformed_request salvage(std::string_view line) {
    malformed_request result;
    part_reader parts{line};
    const auto v = verb_from(parts.next());
    const bool may_be_silent = v == verb::push || v == verb::update;
    std::size_t ids = 0;
    bool seq = false;
    bool epoch = false;
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        if (v == verb::update && part.starts_with("seq=")) {
            seq = number_between(part.substr(4), 1, max_id).has_value();
        } else if (v == verb::update && part.starts_with("epoch=")) {
            epoch = parse_epoch(part.substr(6)).has_value();
        } else if (part.starts_with("id=")) {
            if (const auto id = number_between(part.substr(3), 1, max_id)) {
                result.id = *id;
                ++ids;
            }
        } else if (may_be_silent && part == "reply=no") {
            result.wants_reply = false;
        }
    }
    if (ids != 1) {
        result.id = 0;
    }
    if (seq && epoch) { // an update is never answered, even if it is malformed
        result.wants_reply = false;
    }
    return result;
}

outgoing_request copy_text(const outgoing_request& request, std::string& memory) {
    memory.clear();
    memory.reserve(request.size());
    memory.append(request.noun).append(request.adverbs).append(request.body);
    const std::string_view all{memory};
    auto copy = request;
    copy.noun = all.substr(0, request.noun.size());
    copy.adverbs = all.substr(request.noun.size(), request.adverbs.size());
    copy.body = all.substr(request.noun.size() + request.adverbs.size());
    return copy;
}

void append_request(std::string& out, const outgoing_request& request) {
    out.append(to_string(request.verb)).push_back(' ');
    out.append(request.noun);
    if (request.id != 0) {
        append_adverb(out, "id", request.id);
    }
    if (request.deadline_ms != 0) {
        append_adverb(out, "deadline", request.deadline_ms);
    }
    if (!request.wants_reply) {
        out.append(" reply=no");
    }
    if (request.wants_progress) {
        out.append(" progress=yes");
    }
    if (request.carried.urgent) {
        out.append(" urgent=yes");
    }
    if (request.carried.trace) {
        out.append(" trace=").append(traceparent_text(request.carried.trace));
    }
    if (request.lease_ms) {
        append_adverb(out, "lease", *request.lease_ms);
    }
    if (request.every_ms != 0) {
        append_adverb(out, "every", request.every_ms);
    }
    if (request.keep != 0) {
        append_adverb(out, "keep", request.keep);
    }
    if (request.hops != default_hops) {
        append_adverb(out, "hops", request.hops);
    }
    if (request.wants_mark) {
        out.append(" mark=yes");
    }
    if (!request.adverbs.empty()) {
        out.push_back(' ');
        out.append(request.adverbs);
    }
    if (!request.body.empty()) {
        out.push_back(' ');
        out.append(request.body);
    }
    out.push_back('\n');
}

void append_update_head(std::string& out, std::string_view publisher, std::string_view path, std::uint64_t seq,
                        std::string_view epoch) {
    out.append("UPDATE ").append(publisher).push_back(':');
    out.append(path);
    append_adverb(out, "seq", seq);
    out.append(" epoch=").append(epoch).push_back(' ');
}

std::optional<request_signature> parse_request_signature(std::string_view sig) noexcept {
    const auto dot = std::min(sig.find('.'), sig.size());
    request_signature read{.signature = sig.substr(0, dot)};
    const auto time = sig.substr(std::min(dot + 1, sig.size()));
    return take(read.waits_ms, number_between(time, 1, max_deadline_ms)) ? std::optional{read} : std::nullopt;
}

std::string request_signature_text(const request_signature& sig) {
    return std::string{sig.signature}.append(".").append(std::to_string(sig.waits_ms));
}

std::optional<std::uint32_t> parse_epoch(std::string_view text) noexcept { return parse_hex<std::uint32_t>(text); }

std::optional<std::uint64_t> parse_grant(std::string_view text) noexcept {
    const auto number = parse_hex<std::uint64_t>(text);
    return number != 0U ? number : std::nullopt;
}

std::string epoch_text(std::uint32_t epoch) { return hex_text(epoch); }

std::string grant_text(std::uint64_t grant) { return hex_text(grant); }

// --- The heads of updates ---

namespace {

constexpr std::size_t max_head = 256;
constexpr std::size_t after_size = std::string_view{" epoch=5f3a09c1 "}.size();

bool may_be_json(std::string_view body) noexcept {
    return body.size() >= 2 &&
           ((body.front() == '{' && body.back() == '}') || (body.front() == '[' && body.back() == ']'));
}

} // namespace

void update_head::remember(std::string_view line, const request_line& update) {
    forget();
    const auto head = line.substr(0, line.size() - update.body.size());
    const auto number = head.find(" seq=");
    if (!update.is_update() || head.size() > max_head || number == std::string_view::npos ||
        std::count(head.begin(), head.begin() + static_cast<std::ptrdiff_t>(number), ' ') != 1) {
        return;
    }
    const auto start = number + 5;
    auto end = start;
    while (end < head.size() && json_detail::is_digit(head[end])) {
        ++end;
    }
    const auto rest = head.substr(end);
    if (rest.size() != after_size || !rest.starts_with(" epoch=") || rest.back() != ' ') {
        return;
    }
    text_ = head;
    update_ = std::make_unique<request_line>();
    malformed_request ignored;
    if (parse_request(text_, *update_, ignored)) {
        before_ = head.substr(0, start);
        after_ = rest;
    }
}

const request_line* update_head::recognise(std::string_view line) noexcept {
    if (before_.empty() || !line.starts_with(before_)) {
        return nullptr;
    }
    const auto whole = line;
    line.remove_prefix(before_.size());
    constexpr std::size_t max_digits = 18; // longer ones are left to the parser
    std::uint64_t seq = 0;
    std::size_t digits = 0;
    while (digits < line.size() && digits <= max_digits && json_detail::is_digit(line[digits])) {
        seq = seq * 10 + static_cast<std::uint64_t>(line[digits] - '0');
        ++digits;
    }
    if (digits == 0 || digits > max_digits || line[0] == '0' || !line.substr(digits).starts_with(after_)) {
        return nullptr;
    }
    line.remove_prefix(digits + after_.size());
    if (!may_be_json(line)) {
        return nullptr;
    }
    update_->seq = seq;
    update_->body = line;
    update_->text = whole;
    return update_.get();
}

} // namespace cles::protocol
