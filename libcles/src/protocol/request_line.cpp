// SPDX-License-Identifier: BSL-1.0
#include "protocol/request_line.hpp"

#include "json/characters.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <array>

namespace cles::protocol {
namespace {

bool is_name_list(std::string_view text) noexcept {
    for (;;) {
        const auto comma = text.find(',');
        if (!is_name(text.substr(0, comma))) {
            return false;
        }
        if (comma == std::string_view::npos) {
            return true;
        }
        text.remove_prefix(comma + 1);
    }
}

bool is_epoch_list(std::string_view text) noexcept {
    constexpr std::size_t each = 9; // including its comma
    if (text.size() % each != each - 1 || text.size() > max_described * each) {
        return false;
    }
    for (;; text.remove_prefix(each)) {
        if (!parse_epoch(text.substr(0, each - 1))) {
            return false;
        }
        if (text.size() < each) {
            return true;
        }
        if (text[each - 1] != ',') {
            return false;
        }
    }
}

/// Assigns the value if there is one; returns whether there is.
template <class Target, class Source>
bool take(Target& target, const std::optional<Source>& source) {
    if (source) {
        target = static_cast<std::uint32_t>(*source);
    }
    return source.has_value();
}

enum class known : std::uint8_t {
    id,
    deadline,
    reply,
    hops,
    progress,
    urgent,
    lease,
    every,
    keep,
    seq,
    epoch,
    via,
    since,
    describe,
    mark,
    none
};

constexpr std::array<std::string_view, 15> known_keys{"id",     "deadline", "reply", "hops",     "progress",
                                                      "urgent", "lease",    "every", "keep",     "seq",
                                                      "epoch",  "via",      "since", "describe", "mark"};

constexpr std::uint8_t on(std::initializer_list<verb> verbs) {
    std::uint8_t mask = 0;
    for (const auto v : verbs) {
        mask = static_cast<std::uint8_t>(mask | (1U << static_cast<unsigned>(v)));
    }
    return mask;
}

constexpr std::uint8_t on_all = on({verb::pull, verb::push, verb::delegate, verb::bind, verb::update});
constexpr std::array<std::uint8_t, 15> known_on{on_all,
                                                on_all,
                                                on({verb::push, verb::update}),
                                                on_all,
                                                on({verb::delegate}),
                                                on({verb::pull, verb::push, verb::delegate}),
                                                on({verb::bind}),
                                                on({verb::bind}),
                                                on({verb::bind}),
                                                on({verb::update}),
                                                on({verb::update}),
                                                on_all,
                                                on({verb::pull}),
                                                on({verb::pull}),
                                                on({verb::bind})};

known find_known(std::string_view key, verb v) noexcept {
    for (std::size_t i = 0; i < known_keys.size(); ++i) {
        if (known_keys[i] == key) {
            return (known_on[i] & (1U << static_cast<unsigned>(v))) != 0 ? static_cast<known>(i) : known::none;
        }
    }
    return known::none;
}

bool apply(known k, std::string_view value, request_line& out) {
    switch (k) {
    case known::id:
        if (const auto id = number_between(value, 1, max_id)) {
            out.id = *id;
            return true;
        }
        return false;
    case known::deadline: return take(out.deadline_ms, number_between(value, 1, max_deadline_ms));
    case known::reply: out.wants_reply = false; return value == "no";
    case known::hops:
        if (const auto hops = number_between(value, 0, max_hops)) {
            out.hops = static_cast<std::uint8_t>(*hops);
            return true;
        }
        return false;
    case known::progress: out.wants_progress = true; return value == "yes";
    case known::urgent: out.urgent = true; return value == "yes";
    case known::lease: {
        auto lease = parse_number(value);
        if (!lease && is_number(value)) {
            lease = max_lease_ms; // too long for 64 bits, so the maximum
        }
        return lease && take(out.lease_ms, std::optional{std::min<std::uint64_t>(*lease, max_lease_ms)});
    }
    case known::every: return take(out.every_ms, number_between(value, 1, max_deadline_ms));
    case known::keep: return take(out.keep, number_between(value, 1, max_keep));
    case known::seq: out.seq = number_between(value, 1, max_id); return out.seq.has_value();
    case known::epoch: out.epoch = parse_epoch(value); return out.epoch.has_value();
    case known::via: out.via = value; return is_name_list(value);
    case known::since: out.since = value; return value.size() <= max_since;
    case known::describe: out.describe = value; return is_epoch_list(value);
    case known::mark: out.wants_mark = true; return value == "yes";
    case known::none: break;
    }
    return true;
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
        const auto k = find_known(a.key, out.verb);
        if (k == known::none) {
            if (a.key.starts_with("must_")) {
                why = "the adverb " + quoted(a.key) + " is not known here";
                return false;
            }
            continue;
        }
        const auto bit = 1U << static_cast<unsigned>(k);
        if ((seen & bit) != 0) {
            why = "the adverb " + quoted(a.key) + " stands twice";
            return false;
        }
        seen |= bit;
        if (!apply(k, a.value, out)) {
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

bool is_known_adverb(std::string_view key, verb on) noexcept { return find_known(key, on) != known::none; }

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
    if (request.lease_ms) {
        append_adverb(out, "lease", *request.lease_ms);
    }
    if (request.every_ms != 0) {
        append_adverb(out, "every", request.every_ms);
    }
    if (request.keep != 0) {
        append_adverb(out, "keep", request.keep);
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

std::optional<std::uint32_t> parse_epoch(std::string_view text) noexcept {
    std::uint32_t value = 0;
    if (text.size() != 8) {
        return std::nullopt;
    }
    for (const auto c : text) {
        const bool digit = json_detail::is_digit(c);
        if (!digit && (c < 'a' || c > 'f')) {
            return std::nullopt;
        }
        value = value << 4U | static_cast<std::uint32_t>(digit ? c - '0' : c - 'a' + 10);
    }
    return value;
}

std::string epoch_text(std::uint32_t epoch) {
    constexpr std::string_view digits = "0123456789abcdef";
    std::string text(8, '0');
    for (std::size_t i = 8; i-- > 0; epoch >>= 4U) {
        text[i] = digits[epoch & 0xFU];
    }
    return text;
}

} // namespace cles::protocol
