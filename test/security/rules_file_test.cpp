// SPDX-License-Identifier: BSL-1.0
#include "security/access/local_rules.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

using namespace cles::security;
using cles::verb;

namespace {

// The line of the rule that matches; 0 if there is none.
std::size_t matching_line(const local_rules& rules, std::string_view requester, verb asked, std::string_view noun) {
    cles::protocol::noun_view parts;
    std::string why;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_noun(noun, parts, why), why);
    const auto* const found = rules.find(requester, asked, decoded_noun{parts.target, parts});
    return found == nullptr ? 0 : found->line;
}

} // namespace

BOOST_AUTO_TEST_SUITE(rules_file)

BOOST_AUTO_TEST_CASE(no_rules_match_nothing) {
    for (const auto* const text : {"", "\n", "\n\n  \n\t\n", "# comment", "  # a\n\r\n#\n"}) {
        const auto rules = local_rules::parse(text);
        BOOST_TEST(!rules.denies_everything(), rules.error());
        BOOST_TEST(rules.rules().empty());
        BOOST_TEST(matching_line(rules, "car1", verb::push, "car1:target") == 0U);
    }
    BOOST_TEST(!local_rules{}.denies_everything());
}

BOOST_AUTO_TEST_CASE(the_first_line_that_matches_counts) {
    const auto rules = local_rules::parse("# who may set the target\n"
                                          "\n"
                                          "allow sat1 may push *:target\n"
                                          "  deny\tsat*  may push *:target   # the others not\r\n"
                                          "deny car* offers bind,pull *:log/**");
    BOOST_REQUIRE_MESSAGE(!rules.denies_everything(), rules.error());
    BOOST_TEST(matching_line(rules, "sat1", verb::push, "car1:target") == 3U);
    BOOST_TEST(matching_line(rules, "sat2", verb::push, "car1:target") == 4U);
    BOOST_TEST(matching_line(rules, "sat2", verb::pull, "car1:target") == 0U);
    BOOST_TEST(matching_line(rules, "car2", verb::push, "car1:target") == 0U);
    // `offers` is about the target; who asks does not matter.
    BOOST_TEST(matching_line(rules, "sat2", verb::pull, "car1:log/a") == 5U);
    BOOST_TEST(matching_line(rules, "car2", verb::pull, "sat1:log/a") == 0U);
    // `may` is not about requests of this node.
    BOOST_TEST(matching_line(rules, "", verb::push, "car1:target") == 0U);
    BOOST_TEST(matching_line(rules, "", verb::bind, "car1:log") == 5U);

    BOOST_REQUIRE(rules.rules().size() == 3U);
    BOOST_TEST(rules.rules()[0].allows);
    BOOST_TEST(!rules.rules()[1].allows);
    BOOST_TEST(rules.rules()[1].text == "deny sat* may push *:target");
}

BOOST_AUTO_TEST_CASE(an_error_denies_everything_and_names_its_line) {
    struct row {
        std::string line, expected;
    };
    const std::vector<row> table{
        {"deny", "has the form"},
        {"deny sat* may push", "has the form"},
        {"deny sat* may push *:target now", "has the form"},
        {"deny sat* may push *:target allow * may * *:*", "has the form"},
        {"Deny sat* may push *:target", "begins with 'allow' or 'deny', not with 'Deny'"},
        {"permit sat* may push *:target", "not with 'permit'"},
        {"deny ** may push *:target", "'**' is not the pattern of a node's name"},
        {"deny sat/* may push *:target", "is not the pattern of a node's name"},
        {"deny self may push *:target", "'self' is not the pattern of a node's name"},
        {"deny sat* requests push *:target", "'may' or 'offers', not by 'requests'"},
        {"deny sat* may shove *:target", "'shove' is not a verb"},
        {"deny sat* may push target", "has no ':'"},
        {"deny sat* may push self:target", "no node has the name 'self'"},
        {"deny sat* may push *:plan/**/x", "the parameter '**'"},
        {"deny sat* may push *:plan#/x/", ""}, // a comment
        {"deny sat*\vmay push *:target x", "is not the pattern"},
    };
    for (const auto& each : table) {
        const auto rules = local_rules::parse("allow * may * *:*/**\n\n" + each.line + "\n");
        BOOST_TEST(rules.denies_everything() == !each.expected.empty(), each.line << ": " << rules.error());
        if (!each.expected.empty()) {
            BOOST_TEST(rules.error().starts_with("line 3: 'deny ") == each.line.starts_with("deny "), rules.error());
            BOOST_TEST(rules.error().find(each.expected) != std::string::npos, rules.error());
            BOOST_TEST(rules.rules().empty());
        }
    }
}

BOOST_AUTO_TEST_CASE(a_message_is_short_and_has_no_control_characters) {
    const auto rules = local_rules::parse("deny \x1B[31m" + std::string(5000, 'x') + " may push *:target");
    BOOST_REQUIRE(rules.denies_everything());
    BOOST_TEST(rules.error().size() < 300U);
    BOOST_TEST(rules.error().find('\x1B') == std::string::npos);
    BOOST_TEST(local_rules::parse(std::string_view{"\0", 1}).denies_everything());
}

BOOST_AUTO_TEST_CASE(its_size_is_limited) {
    constexpr std::string_view rule = "deny * may * *:*\n";
    std::string file;
    for (std::size_t i = 0; i < local_rules::max_rules; ++i) {
        file.append(rule);
    }
    BOOST_TEST(!local_rules::parse(file).denies_everything());
    BOOST_TEST(local_rules::parse(file + "# and nothing else\n").rules().size() == local_rules::max_rules);
    const auto more = local_rules::parse(file + std::string{rule});
    BOOST_TEST(more.denies_everything());
    BOOST_TEST(more.error().find("line 1001") != std::string::npos, more.error());
    BOOST_TEST(more.error().find("more than 1000 rules") != std::string::npos, more.error());

    BOOST_TEST(!local_rules::parse(std::string(local_rules::max_size, '#')).denies_everything());
    const auto longer = local_rules::parse(std::string(local_rules::max_size + 1, '#'));
    BOOST_TEST(longer.denies_everything());
    BOOST_TEST(longer.error().find("65536 bytes") != std::string::npos, longer.error());
}

BOOST_AUTO_TEST_CASE(a_file_that_cannot_be_read_denies_everything) {
    const auto rules = local_rules::unreadable("Permission denied");
    BOOST_TEST(rules.denies_everything());
    BOOST_TEST(rules.error() == "Permission denied");
    BOOST_TEST(local_rules::unreadable("").denies_everything());
}

BOOST_AUTO_TEST_SUITE_END()
