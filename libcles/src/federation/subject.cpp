// SPDX-License-Identifier: BSL-1.0
#include "federation/subject.hpp"

#include "protocol/grammar.hpp"
#include "protocol/hex_number.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <span>

namespace cles::bridging {
namespace {

constexpr std::string_view root = "cles";
constexpr std::string_view escaped_dot = "%2E";
constexpr std::array<std::string_view, verb_count> verb_tokens{"pull", "push", "delegate", "bind", "update"};

std::string_view token_of(verb how) noexcept { return verb_tokens[static_cast<std::size_t>(how)]; }

std::string join(std::initializer_list<std::string_view> tokens) {
    std::string made{root};
    for (const auto token : tokens) {
        made.append(".").append(token);
    }
    return made;
}

// A dot separates the tokens of a subject.
std::string encoded(std::string_view name) {
    std::string made;
    for (const char c : name) {
        if (c == '.') {
            made.append(escaped_dot);
        } else {
            made.push_back(c);
        }
    }
    return made;
}

std::optional<std::string> decoded_name(std::string_view token) {
    std::string name;
    while (!token.empty()) {
        const auto at = std::min(token.find('%'), token.size());
        name.append(token.substr(0, at));
        token.remove_prefix(at);
        if (!token.empty()) {
            if (!token.starts_with(escaped_dot)) {
                return {};
            }
            name.push_back('.');
            token.remove_prefix(escaped_dot.size());
        }
    }
    return protocol::is_name(name) ? std::optional{std::move(name)} : std::nullopt;
}

constexpr std::size_t max_tokens = 5;

// Returns how many there are; more than `max_tokens` count as one more.
std::size_t split(std::string_view text, std::array<std::string_view, max_tokens>& tokens) {
    for (std::size_t count = 0;; ++count) {
        const auto dot = text.find('.');
        if (count == max_tokens) {
            return count + 1;
        }
        tokens[count] = text.substr(0, dot);
        if (dot == std::string_view::npos) {
            return count + 1;
        }
        text.remove_prefix(dot + 1);
    }
}

subject of_bridge(subject made, std::string_view kind, std::string_view instance) {
    if (is_instance(instance)) {
        made.kind = kind == "beat" ? subject_kind::heartbeat : subject_kind::names;
        made.instance = instance;
    }
    return made;
}

subject in_inbox(subject made, std::string_view instance, std::string_view what) {
    const auto number = protocol::number_between(what, 1, protocol::max_id);
    const auto kind = number              ? subject_kind::reply
                      : what == "request" ? subject_kind::request
                      : what == "control" ? subject_kind::control
                      : what == "seal"    ? subject_kind::question
                                          : subject_kind::foreign;
    if (is_instance(instance) && kind != subject_kind::foreign) {
        made.kind = kind;
        made.instance = instance;
        made.number = number.value_or(0);
    }
    return made;
}

subject about_task(subject made, std::string_view kind, std::string_view node, std::string_view task) {
    const auto* const how = std::find(verb_tokens.begin(), verb_tokens.end(), kind);
    auto target = decoded_name(node);
    auto of = decoded_name(task);
    if ((how == verb_tokens.end() && kind != "feed") || !target || !of) {
        return made;
    }
    made.kind = kind == "feed" ? subject_kind::feed : subject_kind::request;
    if (how != verb_tokens.end()) {
        made.verb = static_cast<verb>(how - verb_tokens.begin());
    }
    made.node = std::move(*target);
    made.task = std::move(*of);
    return made;
}

} // namespace

bool is_pool_name(std::string_view text) noexcept {
    return protocol::is_name(text) && text.size() <= max_pool_name && text.find('.') == std::string_view::npos &&
           !protocol::is_reserved_target(text);
}

bool is_instance(std::string_view text) noexcept { return protocol::parse_hex<std::uint64_t>(text).has_value(); }

std::string instance_text(std::uint64_t drawn) { return protocol::hex_text(drawn); }

bool are_of_one_member(std::string_view instance, std::string_view other) noexcept {
    constexpr std::size_t number_digits = 6;
    return instance.substr(0, number_digits) == other.substr(0, number_digits);
}

std::string request_subject(std::string_view pool, verb how, std::string_view node, std::string_view task) {
    return join({pool, token_of(how), encoded(node), encoded(task)});
}

std::string request_filter(std::string_view pool, verb how) { return join({pool, token_of(how), "*", "*"}); }

std::string feed_subject(std::string_view pool, std::string_view node, std::string_view task) {
    return join({pool, "feed", encoded(node), encoded(task)});
}

std::string heartbeat_subject(const bridge_id& of) { return join({of.pool, "beat", of.instance}); }
std::string names_subject(const bridge_id& of) { return join({of.pool, "names", of.instance}); }
std::string request_subject(const bridge_id& of) { return join({of.pool, "bridge", of.instance, "request"}); }
std::string control_subject(const bridge_id& of) { return join({of.pool, "bridge", of.instance, "control"}); }
std::string reply_subject(const bridge_id& of, std::uint64_t number) {
    return join({of.pool, "bridge", of.instance, std::to_string(number)});
}
std::string question_subject(const bridge_id& of) { return join({of.pool, "bridge", of.instance, "seal"}); }
std::string inbox_filter(const bridge_id& of) { return join({of.pool, "bridge", of.instance, "*"}); }

subject parse_subject(std::string_view text) {
    std::array<std::string_view, max_tokens> tokens;
    const auto count = split(text, tokens);
    subject made;
    if (count < 4 || count > max_tokens || tokens[0] != root || !is_pool_name(tokens[1])) {
        return made;
    }
    made.pool = tokens[1];
    const auto kind = tokens[2];
    if (count == 4) {
        return kind == "beat" || kind == "names" ? of_bridge(std::move(made), kind, tokens[3]) : made;
    }
    return kind == "bridge" ? in_inbox(std::move(made), tokens[3], tokens[4])
                            : about_task(std::move(made), kind, tokens[3], tokens[4]);
}

} // namespace cles::bridging
