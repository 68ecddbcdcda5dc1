// SPDX-License-Identifier: BSL-1.0
#include "security/access/access_policy.hpp"

#include <boost/json.hpp>
#include <boost/test/unit_test.hpp>

#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

using namespace cles::security;
using cles::verb;
namespace json = boost::json;

namespace {

using cause = access_decision::cause;

// A letter for each cause, as in access_oracle.py.
char letter_of(const access_decision& made) {
    switch (made.by) {
    case cause::permitted: return 'P';
    case cause::exempt: return 'X';
    case cause::unknown_requester: return 'R';
    case cause::unknown_target: return 'T';
    case cause::unknown_forwarder: return 'W';
    case cause::not_forwarded: return 'N';
    case cause::rules_unreadable: return 'U';
    case cause::rule: return 'D';
    case cause::may: return 'M';
    case cause::offers: return 'O';
    }
    return '?';
}

using texts = std::vector<std::string>;

std::optional<texts> texts_of(const json::object& from, std::string_view key) {
    const auto* const found = from.if_contains(key);
    return found == nullptr ? std::nullopt : std::optional{json::value_to<texts>(*found)};
}

member member_of(std::string_view name, const json::object& described) {
    member out;
    out.name = name;
    out.may = texts_of(described, "may");
    out.offers = texts_of(described, "offers");
    out.forwards = texts_of(described, "forwards").value_or(texts{});
    return out;
}

member limited(std::string_view name, std::optional<texts> may, std::optional<texts> offers, texts forwards = {}) {
    member out;
    out.name = name;
    out.may = std::move(may);
    out.offers = std::move(offers);
    out.forwards = std::move(forwards);
    return out;
}

access_policy policy_of(std::vector<member> members, std::string_view rules = "") {
    return {"car1", std::make_shared<const std::vector<member>>(std::move(members)), local_rules::parse(rules)};
}

/// A noun that keeps its text.
struct kept_noun {
    explicit kept_noun(std::string from) : text(std::move(from)) {
        cles::protocol::noun_view parts;
        std::string why;
        BOOST_REQUIRE_MESSAGE(cles::protocol::parse_noun(text, parts, why), why);
        decoded.assign(parts.target, parts);
    }
    std::string text;
    decoded_noun decoded;
};

access_decision decide(const access_policy& policy, std::string_view direction, std::string_view requester,
                       std::string_view forwarder, verb asked, const decoded_noun& noun) {
    return direction == "received"    ? policy.received(requester, forwarder, asked, noun)
           : direction == "delivered" ? policy.received(requester, forwarder, verb::bind, noun)
                                      : policy.sent(forwarder, asked, noun);
}

// The letters of a row, for each noun.
std::string letters_of(const access_policy& policy, const std::string& row,
                       const std::vector<std::unique_ptr<kept_noun>>& nouns) {
    std::istringstream words{row};
    std::string direction;
    std::string requester;
    std::string forwarder;
    std::string asked;
    words >> direction >> requester >> forwarder >> asked;
    std::string out;
    for (const auto& noun : nouns) {
        const auto made = decide(policy, direction, requester, forwarder == "-" ? "" : forwarder,
                                 cles::verb_from(asked).value(), noun->decoded);
        BOOST_REQUIRE(made.allowed() == (made.by == cause::permitted || made.by == cause::exempt));
        out.push_back(letter_of(made));
    }
    return out;
}

} // namespace

BOOST_AUTO_TEST_SUITE(access_decisions)

// The table is made by access_oracle.py, which shares no code with the library.
BOOST_AUTO_TEST_CASE(every_cell_of_the_table_is_decided_as_expected) {
    std::ifstream file{"test/security/access_table.json"};
    const std::string text{std::istreambuf_iterator<char>{file}, {}};
    std::size_t cells = 0;
    std::size_t wrong = 0;
    const auto table = json::parse(text);
    for (const auto& each : table.as_array()) {
        const auto& scenario = each.as_object();
        std::vector<member> members;
        for (const auto& [name, described] : scenario.at("members").as_object()) {
            members.push_back(member_of({name.data(), name.size()}, described.as_object()));
        }
        const access_policy policy{json::value_to<std::string>(scenario.at("self")),
                                   std::make_shared<const std::vector<member>>(std::move(members)),
                                   local_rules::parse(json::value_to<std::string>(scenario.at("rules")))};
        std::vector<std::unique_ptr<kept_noun>> nouns;
        for (const auto& noun : scenario.at("nouns").as_array()) {
            nouns.push_back(std::make_unique<kept_noun>(json::value_to<std::string>(noun)));
        }
        for (const auto& [row, expected] : scenario.at("rows").as_object()) {
            const auto made = letters_of(policy, row, nouns);
            cells += made.size();
            if (made != expected.as_string() && ++wrong < 20) {
                BOOST_ERROR(row << ": " << made << " instead of " << expected << " with rules "
                                << scenario.at("rules"));
            }
        }
    }
    BOOST_TEST(wrong == 0U);
    BOOST_TEST(cells > 50'000U);
}

BOOST_AUTO_TEST_CASE(a_decision_names_the_line_that_decides) {
    const auto policy = policy_of(
        {limited("car1", {}, texts{"pull *:*", "* *:target"}), limited("car2", texts{"x", "push *:target"}, {})},
        "# exceptions\nallow car2 may push *:target\ndeny * may push *:*\n");
    const kept_noun target{"car1:target"};
    const auto made = policy.received("car2", "", verb::push, target.decoded);
    BOOST_TEST(made.allowed());
    BOOST_REQUIRE(made.rule != nullptr);
    BOOST_TEST(made.rule->line == 2U);
    BOOST_TEST(made.may == 1);
    BOOST_TEST(made.offers == 1);

    const auto denied = policy.received("car1", "", verb::push, target.decoded);
    BOOST_TEST((denied.by == cause::rule));
    BOOST_REQUIRE(denied.rule != nullptr);
    BOOST_TEST(denied.rule->text == "deny * may push *:*");
}

BOOST_AUTO_TEST_CASE(rules_do_not_permit_what_the_roster_does_not) {
    const auto policy = policy_of({limited("car1", {}, {}), limited("car2", texts{}, {})}, "allow * may * *:*/**\n");
    const auto made = policy.received("car2", "", verb::pull, kept_noun{"car1:target"}.decoded);
    BOOST_TEST((made.by == cause::may));
    BOOST_REQUIRE(made.rule != nullptr);
    BOOST_TEST(made.rule->allows);
}

BOOST_AUTO_TEST_CASE(what_every_node_serves_is_exempt) {
    const auto policy =
        policy_of({limited("car1", {}, texts{}), limited("car2", texts{}, {})}, "deny * may * *:*/**\n");
    for (const auto* const what : {"cancel/5", "hello", "leaving", "roster", "announced/x", "slots"}) {
        const kept_noun noun{std::string{"car1:cles/"} + what};
        BOOST_TEST((policy.received("car2", "", verb::push, noun.decoded).by == cause::exempt), what);
    }
    for (const auto* const other :
         {"car1:cles", "car1:cles/peers", "car1:cles/x/slots", "car1:slots", "car1:x/slots"}) {
        const kept_noun noun{other};
        BOOST_TEST((policy.received("car2", "", verb::push, noun.decoded).by == cause::rule), other);
    }
}

BOOST_AUTO_TEST_CASE(updates_count_as_bind) {
    const auto policy =
        policy_of({limited("car1", {}, texts{"bind *:target", "update *:log"}), limited("car2", {}, {})});
    BOOST_TEST(policy.received("car2", "", verb::bind, kept_noun{"car1:target"}.decoded).allowed());
    BOOST_TEST(!policy.received("car2", "", verb::bind, kept_noun{"car1:log"}.decoded).allowed());
    // An UPDATE that asks a node to publish is a request like others.
    BOOST_TEST(policy.received("car2", "", verb::update, kept_noun{"car1:log"}.decoded).allowed());
    BOOST_TEST(!policy.received("car2", "", verb::update, kept_noun{"car1:target"}.decoded).allowed());
}

BOOST_AUTO_TEST_CASE(rules_about_requests_here_are_not_about_own_requests) {
    const auto policy = policy_of({limited("car1", {}, {}), limited("car2", {}, {})},
                                  "deny * may push *:target\ndeny car2 offers pull *:log\n");
    BOOST_TEST(policy.sent("", verb::push, kept_noun{"car2:target"}.decoded).allowed());
    BOOST_TEST(!policy.sent("", verb::pull, kept_noun{"car2:log"}.decoded).allowed());
    BOOST_TEST(policy.received("car2", "", verb::pull, kept_noun{"car1:log"}.decoded).allowed());
    BOOST_TEST(!policy.received("car2", "", verb::push, kept_noun{"car1:target"}.decoded).allowed());
}

BOOST_AUTO_TEST_CASE(who_may_forward_for_whom) {
    const auto policy = policy_of({limited("car1", {}, {}), limited("car2", {}, {}), limited("sat1", {}, {}, {"car*"}),
                                   limited("sat2", {}, {}, {"**", "sat1 ", "", "sat1"})});
    BOOST_TEST(policy.may_forward("sat1", "car1"));
    BOOST_TEST(policy.may_forward("sat1", "car2"));
    BOOST_TEST(!policy.may_forward("sat1", "sat2"));
    BOOST_TEST(policy.may_forward("sat2", "sat1"));
    BOOST_TEST(!policy.may_forward("sat2", "car1"));
    BOOST_TEST(!policy.may_forward("car1", "car2"));
    BOOST_TEST(policy.may_forward("car1", "car1"));
    BOOST_TEST(!policy.may_forward("sat1", "car3")); // not a member
    BOOST_TEST(!policy.may_forward("ghost", "ghost"));
    BOOST_TEST(!policy.may_forward("", "car1"));
}

BOOST_AUTO_TEST_SUITE_END()
