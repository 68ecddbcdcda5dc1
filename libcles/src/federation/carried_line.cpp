// SPDX-License-Identifier: BSL-1.0
#include "federation/carried_line.hpp"

#include "federation/subject.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>

namespace cles::bridging {
namespace {

// Ends the entry of `via` for a pool that the request comes from.
constexpr std::string_view crossed = ".nats";
constexpr std::string_view taken_key = "taken=";
constexpr std::string_view cancel_path = "cles/cancel/";
constexpr std::string_view unbound_path = "cles/unbound/";

std::string numbered_line(std::string_view path, std::uint64_t number) {
    return std::string{"PUSH self:"}.append(path).append(std::to_string(number));
}

std::optional<std::uint64_t> number_after(std::string_view path, const protocol::request_line& r) noexcept {
    return r.noun.path.starts_with(path)
               ? std::optional{protocol::parse_number(r.noun.path.substr(path.size())).value_or(0)}
               : std::nullopt;
}

// Appends the adverbs, without `id`, and the body. \param home of the names in `via`; nothing: `via` is left out
// \param deadline_ms instead of the request's; 0: that one
void append_rest(std::string& out, const protocol::request_line& r, std::optional<std::string_view> home,
                 std::uint32_t deadline_ms = 0) {
    if (deadline_ms != 0) {
        out.append(" deadline=").append(std::to_string(deadline_ms));
    }
    protocol::part_reader parts{r.text};
    parts.next(); // verb
    parts.next(); // noun
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        const bool is_via = part.starts_with("via=");
        if (part.starts_with("id=") || (is_via && !home) || (deadline_ms != 0 && part.starts_with("deadline="))) {
            continue;
        }
        out.push_back(' ');
        if (!is_via || home->empty()) {
            out.append(part);
            continue;
        }
        out.append("via=");
        for (auto left = r.via; !left.empty();) {
            const auto comma = left.find(',');
            const auto from = out.size();
            out.append(*home).append(".").append(left.substr(0, comma));
            out.resize(std::min(out.size(), from + protocol::max_name)); // the pool is what ends loops
            left.remove_prefix(comma == std::string_view::npos ? left.size() : comma + 1);
            if (!left.empty()) {
                out.push_back(',');
            }
        }
    }
    if (!r.body.empty()) {
        out.append(" ").append(r.body);
    }
}

} // namespace

std::string message_of(const protocol::request_line& request, std::string_view home, std::uint32_t deadline_ms) {
    std::string made{request.noun.path.substr(request.noun.task.size())};
    append_rest(made, request, home, deadline_ms);
    return made;
}

std::string message_within_pool(const protocol::request_line& request, std::uint32_t deadline_ms) {
    std::string made{request.noun.path.substr(request.noun.task.size())};
    append_rest(made, request, {}, deadline_ms);
    return made;
}

std::string line_of(const protocol::request_line& request, std::uint64_t id, std::string_view from) {
    std::string made{to_string(request.verb)};
    made.append(" ")
        .append(noun_of(request))
        .append(" id=")
        .append(std::to_string(id))
        .append(" via=")
        .append(via_of(request, from));
    append_rest(made, request, {});
    return made;
}

std::string via_of(const protocol::request_line& request, std::string_view from) {
    auto made = std::string{from.empty() ? "program" : from}.append(crossed);
    if (!request.via.empty()) {
        made.append(",").append(request.via);
    }
    return made;
}

bool has_crossed(std::string_view via) noexcept {
    return protocol::any_in_via(via, [](std::string_view node) { return node.ends_with(crossed); });
}

std::string text_of(verb how, std::string_view node, std::string_view task, std::string_view message) {
    std::string made{to_string(how)};
    made.append(" ").append(node).append(":").append(task);
    if (!message.empty() && message.front() != '/' && message.front() != ' ') {
        made.push_back(' ');
    }
    return made.append(message);
}

std::string noun_of(const protocol::request_line& request) {
    return std::string{request.noun.target}.append(":").append(request.noun.path);
}

bool has_passed(std::string_view via, std::string_view pool) noexcept {
    return protocol::any_in_via(via, [pool](std::string_view node) {
        return node.size() > pool.size() && node.starts_with(pool) && node[pool.size()] == '.';
    });
}

reply_parts split_reply(std::string_view line) noexcept {
    constexpr std::string_view key = "id=";
    if (!line.starts_with(key)) {
        return {};
    }
    line.remove_prefix(key.size());
    const auto space = line.find(' ');
    const auto id = protocol::number_between(line.substr(0, space), 1, protocol::max_id);
    if (!id || space == std::string_view::npos) {
        return {};
    }
    line.remove_prefix(space + 1);
    return {.id = *id, .rest = line, .is_interim = line.starts_with("progress=")};
}

std::string reply_line(std::uint64_t id, std::string_view rest) {
    std::string line;
    protocol::append_reply_head(line, id);
    return line.append(rest);
}

std::string taken_text(std::string_view instance) { return std::string{taken_key}.append(instance); }

std::string_view take_taker(std::string_view& message) noexcept {
    if (!message.starts_with(taken_key)) {
        return {};
    }
    const auto end = std::min(message.find(' '), message.size());
    const auto instance = message.substr(taken_key.size(), end - taken_key.size());
    if (!is_instance(instance)) {
        return {};
    }
    message.remove_prefix(std::min(end + 1, message.size()));
    return instance;
}

std::string cancel_line(std::uint64_t number) { return numbered_line(cancel_path, number); }

std::optional<std::uint64_t> cancelled_number(const protocol::request_line& request) noexcept {
    return number_after(cancel_path, request);
}

std::string unbound_line(std::uint64_t number) { return numbered_line(unbound_path, number); }

std::optional<std::uint64_t> unbound_number(const protocol::request_line& request) noexcept {
    return number_after(unbound_path, request);
}

} // namespace cles::bridging
