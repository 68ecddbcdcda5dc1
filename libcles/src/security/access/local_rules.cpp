// SPDX-License-Identifier: BSL-1.0
#include "security/access/local_rules.hpp"

#include "security/access/wildcard.hpp"
#include "security/keys/keys.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {
namespace {

constexpr std::size_t words_of_rule = 5;

/// What is wrong with a line.
struct line_error {
    std::string why;
};

bool is_blank(char c) noexcept { return c == ' ' || c == '\t'; }

// The words of a line, of which at most one more than a rule has are needed.
std::vector<std::string_view> words_of(std::string_view line) {
    std::vector<std::string_view> out;
    while (out.size() <= words_of_rule) {
        const auto* const from = std::find_if_not(line.begin(), line.end(), is_blank);
        const auto* const end = std::find_if(from, line.end(), is_blank);
        if (from == end) {
            break;
        }
        out.emplace_back(from, static_cast<std::size_t>(end - from));
        line.remove_prefix(static_cast<std::size_t>(end - line.begin()));
    }
    return out;
}

local_rules::rule read_rule(const std::vector<std::string_view>& words) {
    if (words.size() != words_of_rule) {
        throw line_error{"a rule has the form 'allow|deny NAME may|offers VERBS NOUN', as in 'deny sat* may push "
                         "*:target'"};
    }
    if (words[0] != "allow" && words[0] != "deny") {
        throw line_error{"a rule begins with 'allow' or 'deny', not with " + protocol::quoted(words[0])};
    }
    if (!is_name_pattern(words[1]) || protocol::is_reserved_target(words[1])) {
        throw line_error{protocol::quoted(words[1]) + " is not the pattern of a node's name"};
    }
    if (words[2] != "may" && words[2] != "offers") {
        throw line_error{"the name is followed by 'may' or 'offers', not by " + protocol::quoted(words[2])};
    }
    std::string why;
    auto what = right::parse(std::string{words[3]}.append(" ").append(words[4]), &why);
    if (!what) {
        throw line_error{std::move(why)};
    }
    return {.allows = words[0] == "allow",
            .about = words[2] == "may" ? local_rules::subject::may : local_rules::subject::offers,
            .name = std::string{words[1]},
            .what = std::move(*what)};
}

// For messages: at most 200 characters, without control characters.
std::string excerpt(std::string text) {
    constexpr std::size_t longest = 200;
    if (text.size() > longest) {
        text.replace(longest, std::string::npos, "...");
    }
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
    std::replace_if(text.begin(), text.end(), is_control, '?');
    return text;
}

std::string joined(const std::vector<std::string_view>& words) {
    std::string out;
    for (const auto word : words) {
        out.append(out.empty() ? "" : " ").append(word);
    }
    return out;
}

} // namespace

local_rules local_rules::parse(std::string_view file) {
    if (file.size() > max_size) {
        return unreadable("it has more than " + std::to_string(max_size) + " bytes");
    }
    local_rules out;
    for (std::size_t number = 1; !file.empty(); ++number) {
        auto line = file.substr(0, file.find('\n'));
        file.remove_prefix(std::min(file.size(), line.size() + 1));
        line = line.substr(0, line.find('#'));
        if (line.ends_with('\r')) {
            line.remove_suffix(1);
        }
        const auto words = words_of(line);
        if (words.empty()) {
            continue;
        }
        try {
            if (out.rules_.size() == max_rules) {
                throw line_error{"more than " + std::to_string(max_rules) + " rules"};
            }
            out.rules_.push_back(read_rule(words));
            out.rules_.back().line = number;
            out.rules_.back().text = joined(words);
        } catch (const line_error& e) {
            return unreadable(excerpt("line " + std::to_string(number) + ": '" + std::string{line} + "': " + e.why));
        }
    }
    return out;
}

local_rules local_rules::unreadable(std::string why) {
    local_rules out;
    out.error_ = why.empty() ? "it cannot be read" : std::move(why);
    return out;
}

const local_rules::rule* local_rules::find(std::string_view requester, verb asked,
                                           const decoded_noun& noun) const noexcept {
    const auto matches = [&](const rule& each) {
        const auto name = each.about == subject::may ? requester : noun.target();
        return !name.empty() && each.what.permits(asked, noun) && matches_name(each.name, name);
    };
    const auto found = std::find_if(rules_.begin(), rules_.end(), matches);
    return found == rules_.end() ? nullptr : &*found;
}

local_rules read_local_rules(const protected_folder& folder) try {
    const auto content = folder.read_text("rules", local_rules::max_size);
    return content ? local_rules::parse(*content) : local_rules{};
} catch (const security_error& e) {
    return local_rules::unreadable(e.what());
}

} // namespace cles::security
