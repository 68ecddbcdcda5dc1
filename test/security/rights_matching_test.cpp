// SPDX-License-Identifier: BSL-1.0
#include "security/access/rights.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

using namespace cles::security;
using cles::verb;

namespace {

constexpr verb every_verb[] = {verb::pull, verb::push, verb::delegate, verb::bind, verb::update};

// Whether a right of this text permits the verb on this noun, whose target serves.
bool permits(std::string_view text, verb asked, std::string_view noun) {
    cles::protocol::noun_view parts;
    std::string why;
    BOOST_REQUIRE_MESSAGE(cles::protocol::parse_noun(noun, parts, why), why);
    const auto parsed = right::parse(text);
    return parsed && parsed->permits(asked, decoded_noun{parts.target, parts});
}

} // namespace

BOOST_AUTO_TEST_SUITE(rights_matching)

BOOST_AUTO_TEST_CASE(verbs_are_all_or_those_of_a_list) {
    for (const auto asked : every_verb) {
        BOOST_TEST(permits("* car1:target", asked, "car1:target"));
        BOOST_TEST(permits("pull,push,delegate,bind,update car1:target", asked, "car1:target"));
        BOOST_TEST(permits("bind,pull,bind car1:target", asked, "car1:target") ==
                   (asked == verb::bind || asked == verb::pull));
        BOOST_TEST(permits("update car1:target", asked, "car1:target") == (asked == verb::update));
    }
}

BOOST_AUTO_TEST_CASE(nouns_match_part_by_part) {
    struct row {
        std::string_view pattern, noun;
        bool permitted;
    };
    constexpr row table[] = {
        {"car1:target", "car1:target", true},
        {"car1:target", "car2:target", false},
        {"car1:target", "car1:targets", false},
        {"car1:target", "car1:target/5", false},
        {"*:target", "car2:target", true},
        {"car*:t*", "car2:target", true},
        {"car*:t*", "sat2:target", false},
        {"*:*", "car1:plan/a", false},
        {"*:*/*", "car1:plan/a", true},
        {"*:*/*", "car1:plan", false},
        {"*:*/*", "car1:plan/a/b", false},
        {"car1:plan/**", "car1:plan", true},
        {"car1:plan/**", "car1:plan/a/b/c", true},
        {"car1:plan/**", "car1:plans/a", false},
        {"car1:plan/a/**", "car1:plan", false},
        {"car1:plan/a/**", "car1:plan/a", true},
        {"car1:plan/a/**", "car1:plan/a/b", true},
        {"car1:plan/a/**", "car1:plan/b/b", false},
        {"car1:plan/*/b", "car1:plan/a/b", true},
        {"car1:plan/*/b", "car1:plan/a/c", false},
        {"car1:plan/a*c", "car1:plan/abc", true},
        {"car1:plan/a*c", "car1:plan/ac", true},
        {"car1:plan/a*c", "car1:plan/a/c", false},
        {"*:*/**", "car1:plan/a/b", true},
        {"Car1:target", "car1:target", false},
    };
    for (const auto& each : table) {
        BOOST_TEST(permits("pull " + std::string{each.pattern}, verb::pull, each.noun) == each.permitted,
                   each.pattern << " " << each.noun);
    }
}

BOOST_AUTO_TEST_CASE(nouns_are_compared_decoded) {
    // An escape is its character, in the pattern too, where it is never a wildcard or a separator.
    BOOST_TEST(permits("pull car1:log/a", verb::pull, "car1:log/%61"));
    BOOST_TEST(permits("pull car1:log/%61", verb::pull, "car1:log/a"));
    BOOST_TEST(permits("pull car1:log/%c3%a4", verb::pull, "car1:log/%C3%A4"));
    BOOST_TEST(permits("pull car1:log/a%2Fb", verb::pull, "car1:log/a%2Fb"));
    BOOST_TEST(permits("pull car1:log/*", verb::pull, "car1:log/a%2Fb"));
    BOOST_TEST(!permits("pull car1:log/a/b", verb::pull, "car1:log/a%2Fb"));
    BOOST_TEST(!permits("pull car1:log/a%2Fb", verb::pull, "car1:log/a/b"));
    BOOST_TEST(permits("pull car1:log/a%2Ab", verb::pull, "car1:log/a%2Ab"));
    BOOST_TEST(!permits("pull car1:log/a%2Ab", verb::pull, "car1:log/axb"));
    BOOST_TEST(permits("pull car1:log/a*b", verb::pull, "car1:log/a%2Ab"));
    // The text of an escape is not what is compared.
    BOOST_TEST(!permits("pull car1:log/*20", verb::pull, "car1:log/a%20"));
    BOOST_TEST(!permits("pull car1:log/*0*", verb::pull, "car1:log/%20"));
    BOOST_TEST(permits("pull car1:log/*%20*", verb::pull, "car1:log/a%20b"));
}

BOOST_AUTO_TEST_CASE(the_target_is_the_node_that_serves) {
    cles::protocol::noun_view parts;
    std::string why;
    BOOST_REQUIRE(cles::protocol::parse_noun("any:target", parts, why));
    const auto parsed = right::parse("push car1:target");
    BOOST_REQUIRE(parsed.has_value());
    BOOST_TEST(parsed->permits(verb::push, decoded_noun{"car1", parts}));
    BOOST_TEST(!parsed->permits(verb::push, decoded_noun{"car2", parts}));
}

BOOST_AUTO_TEST_CASE(a_noun_is_assigned_again) {
    cles::protocol::noun_view parts;
    std::string why;
    decoded_noun noun;
    for (const auto* const text :
         {"car1:log/%61%62", "car1:log/c", "car1:log/%64/%65%65%65%65%65%65%65%65%65%65%65%65"}) {
        BOOST_REQUIRE(cles::protocol::parse_noun(text, parts, why));
        noun.assign("car1", parts);
    }
    BOOST_TEST(noun.target() == "car1");
    BOOST_TEST(noun.task() == "log");
    BOOST_REQUIRE(noun.parameters().size() == 2U);
    BOOST_TEST(noun.parameters()[0] == "d");
    BOOST_TEST(noun.parameters()[1] == "eeeeeeeeeeee");
}

BOOST_AUTO_TEST_CASE(another_form_permits_nothing_and_says_why) {
    const std::string many(65, 'a');
    std::string deep = "pull car1:plan";
    for (int i = 0; i < 33; ++i) {
        deep.append("/a");
    }
    const std::vector<std::pair<std::string, std::string>> table{
        {"", "is not VERBS NOUN"},
        {"pull", "is not VERBS NOUN"},
        {"pull\tcar1:target", "is not VERBS NOUN"},
        {" car1:target", "is not a verb"},
        {"PULL car1:target", "is not a verb"},
        {"Pull car1:target", "is not a verb"},
        {"fetch car1:target", "'fetch' is not a verb"},
        {"pull, car1:target", "'' is not a verb"},
        {",pull car1:target", "'' is not a verb"},
        {"pull,*,push car1:target", "'*' is not a verb"},
        {"pull target", "has no ':'"},
        {"pull :target", "the target ''"},
        {"pull car1:", "the task ''"},
        {"pull  car1:target", "the target ' car1'"},
        {"pull car1:target ", "the task 'target '"},
        {"pull car1:a:b", "the task 'a:b'"},
        {"pull **:target", "the target '**'"},
        {"pull car1:**", "the task '**'"},
        {"pull car 1:target", "the target 'car 1'"},
        {"pull car%31:target", "the target"},
        {"pull " + many + ":target", "the target"},
        {"pull self:target", "no node has the name 'self'"},
        {"pull any:target", "no node has the name 'any'"},
        {"pull all:target", "no node has the name 'all'"},
        {"pull car1:plan/", "the parameter ''"},
        {"pull car1:plan//b", "the parameter ''"},
        {"pull car1:plan/**/b", "the parameter '**'"},
        {"pull car1:plan/a**", "the parameter 'a**'"},
        {"pull car1:plan/**/**", "the parameter '**'"},
        {"pull car1:plan/a b", "the parameter 'a b'"},
        {"pull car1:plan/%6", "the parameter '%6'"},
        {"pull car1:plan/%*41", "the parameter"},
        {"pull car1:plan/%00", "the parameter"},
        {"pull car1:plan/%FF", "the parameter"},
        {"pull car1:plan/%C3*%A4", "the parameter"},
        {"pull car1:plan/\x01", "the parameter"},
        {deep, "more than 32 parameters"},
    };
    for (const auto& [text, expected] : table) {
        std::string why;
        BOOST_TEST(!right::parse(text, &why), text);
        BOOST_TEST(why.find(expected) != std::string::npos, text << ": " << why);
    }
}

BOOST_AUTO_TEST_CASE(a_list_permits_what_one_of_its_rights_does) {
    cles::protocol::noun_view parts;
    std::string why;
    BOOST_REQUIRE(cles::protocol::parse_noun("car1:target", parts, why));
    const decoded_noun noun{"car1", parts};
    using list = std::vector<std::string>;
    using compiled = rights;
    BOOST_TEST(compiled{std::nullopt}.find(verb::push, noun) == compiled::everything);
    BOOST_TEST(compiled{list{}}.find(verb::push, noun) == compiled::nothing);
    BOOST_TEST(compiled{list{"push *:target"}}.find(verb::pull, noun) == compiled::nothing);
    const compiled several{list{"nonsense", "pull *:target", "push car1:target", "* *:*"}};
    BOOST_TEST(several.find(verb::push, noun) == 2);
    BOOST_TEST(several.find(verb::pull, noun) == 1);
    BOOST_TEST(several.find(verb::bind, noun) == 3);
}

BOOST_AUTO_TEST_SUITE_END()
