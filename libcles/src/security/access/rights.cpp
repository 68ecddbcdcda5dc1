// SPDX-License-Identifier: BSL-1.0
#include "security/access/rights.hpp"

#include <cles/security/member_rights.hpp>

#include "security/access/wildcard.hpp"

#include <algorithm>

namespace cles::security {
namespace {

// In a compiled pattern, `any` is a wildcard, and each part ends with `part_end`. Neither occurs in a decoded noun,
// which may contain '*' and '/' as characters.
constexpr char any = '\x01';
constexpr char part_end = '\x02';

constexpr std::uint8_t bit(verb v) noexcept { return static_cast<std::uint8_t>(1U << static_cast<unsigned>(v)); }

constexpr std::uint8_t all_verbs = (1U << verb_count) - 1;

/// What is wrong with a right.
struct refusal {
    std::string why;
};

std::uint8_t read_verbs(std::string_view text) {
    if (text == "*") {
        return all_verbs;
    }
    std::uint8_t out = 0;
    for (std::size_t from = 0; from <= text.size();) {
        const auto word = text.substr(from, text.find(',', from) - from);
        const bool is_small = std::all_of(word.begin(), word.end(), [](char c) { return c >= 'a' && c <= 'z'; });
        const auto known = is_small ? verb_from(word) : std::nullopt;
        if (!known) {
            throw refusal{protocol::quoted(word) + " is not a verb: write '*', or a list of pull, push, delegate, bind "
                                                   "and update, as in 'pull,bind'"};
        }
        out |= bit(*known);
        from += word.size() + 1;
    }
    return out;
}

void append_name(std::string_view pattern, std::string_view what, std::string& out) {
    if (const auto flaw = flaw_of_name_pattern(pattern); !flaw.empty()) {
        throw refusal{"the " + std::string{what} + " " + flaw};
    }
    out.append(pattern);
    std::replace(out.end() - static_cast<std::ptrdiff_t>(pattern.size()), out.end(), '*', any);
    out.push_back(part_end);
}

// What is between two '*' is written as in a noun.
void append_parameter(std::string_view pattern, std::string& out) {
    auto rest = pattern;
    bool valid = !pattern.empty() && pattern.find("**") == std::string_view::npos;
    while (valid && !rest.empty()) {
        const auto literal = rest.substr(0, rest.find('*'));
        valid = literal.empty() || protocol::is_parameter(literal);
        protocol::decode_parameter(literal, out);
        rest.remove_prefix(literal.size());
        if (!rest.empty()) {
            out.push_back(any);
            rest.remove_prefix(1);
        }
    }
    if (!valid) {
        throw refusal{"the parameter " + protocol::quoted(pattern) +
                      " is not a pattern (characters as in a noun, '*' for any characters, '/**' only at the end)"};
    }
    out.push_back(part_end);
}

// Whether the next part of the pattern fits the text.
bool next_fits(std::string_view& pattern, std::string_view text) noexcept {
    const auto part = pattern.substr(0, pattern.find(part_end));
    pattern.remove_prefix(part.size() + 1);
    return matches_wildcard(part, text, any);
}

} // namespace

void decoded_noun::assign(std::string_view target, const protocol::noun_view& noun) {
    target_ = target;
    task_ = noun.task;
    parameters_ = noun.parameters;
    if (noun.path.find('%') == std::string_view::npos) {
        return;
    }
    decoded_.clear();
    decoded_.reserve(noun.path.size()); // never exceeded, so the views stay valid
    for (auto& parameter : parameters_) {
        const auto from = decoded_.size();
        protocol::decode_parameter(parameter, decoded_);
        parameter = std::string_view{decoded_}.substr(from);
    }
}

std::optional<right> right::parse(std::string_view text, std::string* why) try {
    const auto space = text.find(' ');
    if (space == std::string_view::npos) {
        throw refusal{protocol::quoted(text) + " is not VERBS NOUN, as in 'pull,bind *:localization'"};
    }
    right out;
    out.verbs_ = read_verbs(text.substr(0, space));
    auto noun = text.substr(space + 1);
    if (noun.ends_with("/**")) {
        out.further_ = true;
        noun.remove_suffix(3);
    }
    const auto colon = noun.find(':');
    if (colon == std::string_view::npos) {
        throw refusal{"the noun " + protocol::quoted(noun) + " has no ':' between target and task"};
    }
    const auto target = noun.substr(0, colon);
    if (protocol::is_reserved_target(target)) {
        throw refusal{"no node has the name " + protocol::quoted(target) + "; '*' is every node"};
    }
    append_name(target, "target", out.pattern_);
    noun.remove_prefix(colon + 1);
    auto slash = noun.find('/');
    append_name(noun.substr(0, slash), "task", out.pattern_);
    while (slash != std::string_view::npos) {
        if (++out.parameters_ > protocol::max_parameters) {
            throw refusal{"more than 32 parameters"};
        }
        noun.remove_prefix(slash + 1);
        slash = noun.find('/');
        append_parameter(noun.substr(0, slash), out.pattern_);
    }
    return out;
} catch (refusal& refused) {
    if (why != nullptr) {
        *why = std::move(refused.why);
    }
    return std::nullopt;
}

bool right::permits(verb asked, const decoded_noun& noun) const noexcept {
    const auto parameters = noun.parameters();
    if ((verbs_ & bit(asked)) == 0 || (further_ ? parameters.size() < parameters_ : parameters.size() != parameters_)) {
        return false;
    }
    std::string_view rest{pattern_};
    return next_fits(rest, noun.target()) && next_fits(rest, noun.task()) &&
           std::all_of(parameters.begin(), parameters.begin() + static_cast<std::ptrdiff_t>(parameters_),
                       [&](std::string_view parameter) { return next_fits(rest, parameter); });
}

rights::rights(const std::optional<std::vector<std::string>>& listed) : unlimited_(!listed) {
    if (unlimited_) {
        return;
    }
    for (std::size_t i = 0; i < listed->size(); ++i) {
        if (auto valid = right::parse((*listed)[i])) {
            valid_.emplace_back(static_cast<std::int32_t>(i), std::move(*valid));
        }
    }
}

std::int32_t rights::find(verb asked, const decoded_noun& noun) const noexcept {
    if (unlimited_) {
        return everything;
    }
    const auto found =
        std::find_if(valid_.begin(), valid_.end(), [&](const auto& each) { return each.second.permits(asked, noun); });
    return found == valid_.end() ? nothing : found->first;
}

std::string flaw_of_right(std::string_view text) {
    std::string why;
    return right::parse(text, &why) ? std::string{} : why;
}

std::string flaw_of_name_pattern(std::string_view text) {
    if (is_name_pattern(text)) {
        return {};
    }
    return protocol::quoted(text) +
           " is not the pattern of a name (letters, digits, '_', '-', '.', and '*' for any characters)";
}

} // namespace cles::security
