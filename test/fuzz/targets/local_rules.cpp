// SPDX-License-Identifier: BSL-1.0
// A requester, a verb and a noun in the first line, and then a file of rules: it is read, or denies everything and says
// why; each rule can be written and read again; the first rule that matches by the simplest reading of it decides.
#include "security/access/local_rules.hpp"

#include "fuzz/fuzz.hpp"
#include "fuzz/naive_rights.hpp"

namespace cles::fuzz {
namespace {

// The line of the first rule that matches; 0 if there is none.
std::size_t first_match(const security::local_rules& rules, const std::string& requester, const std::string& verb,
                        const std::string& noun) {
    for (const auto& each : rules.rules()) {
        const auto words = split(each.text, ' ');
        const std::string name = words[2] == "may" ? requester : split(noun, ':').front();
        if (naive_match(read_part(words[1], true), read_part(name, false)) &&
            naive_permits(words[3] + " " + words[4], verb, noun)) {
            return each.line;
        }
    }
    return 0;
}

void check_written(const security::local_rules& rules) {
    std::string written;
    for (const auto& each : rules.rules()) {
        written.append(each.text).append("\n");
    }
    const auto again = security::local_rules::parse(written);
    require(!again.denies_everything() && again.rules().size() == rules.rules().size(), "written rules can be read",
            written);
    for (std::size_t i = 0; i < again.rules().size(); ++i) {
        require(again.rules()[i].text == rules.rules()[i].text && again.rules()[i].line == i + 1, "they are the same",
                written);
    }
}

} // namespace

void run(std::string_view input) {
    const auto end = input.find('\n');
    const auto rules = security::local_rules::parse(end == std::string_view::npos ? input : input.substr(end + 1));
    if (rules.denies_everything()) {
        require(rules.rules().empty() && rules.error().size() < 400, "broken rules are not used", rules.error());
        return;
    }
    check_written(rules);
    const auto words = split(input.substr(0, end), ' ');
    if (words.size() != 3 || !protocol::is_name(words[0]) || input.size() > 2000) {
        return; // the simple reading takes time in proportion to the product of the lengths
    }
    protocol::noun_view parts;
    std::string why;
    for (const auto* const verb : {"pull", "push", "delegate", "bind", "update"}) {
        if (words[1] == verb && protocol::parse_noun(words[2], parts, why)) {
            const auto* const found =
                rules.find(words[0], verb_from(verb).value(), security::decoded_noun{parts.target, parts});
            require((found == nullptr ? 0 : found->line) == first_match(rules, words[0], verb, words[2]),
                    "the first rule that matches decides", input);
        }
    }
}

} // namespace cles::fuzz
