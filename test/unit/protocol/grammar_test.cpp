// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/parameter.hpp>

#include "protocol/grammar.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace grammar {
namespace {

using cles::protocol::noun_view;

struct split {
    bool ok = false;
    noun_view noun;
    std::string why;
};

split parse(std::string_view text) {
    split result;
    result.ok = cles::protocol::parse_noun(text, result.noun, result.why);
    return result;
}

std::string decoded(std::string_view parameter) {
    std::string out;
    cles::protocol::decode_parameter(parameter, out);
    return out;
}

std::string encoded(std::string_view text) {
    std::string out;
    cles::protocol::encode_parameter(text, out);
    return out;
}

std::string canonical(std::string_view text) {
    std::string scratch;
    return std::string{cles::protocol::canonical_path(parse(text).noun, scratch)};
}

std::string repeated(std::string_view text, std::size_t times) {
    std::string out;
    for (std::size_t i = 0; i < times; ++i) {
        out += text;
    }
    return out;
}

} // namespace
} // namespace grammar

BOOST_AUTO_TEST_SUITE(grammar)

BOOST_AUTO_TEST_CASE(a_name_is_1_to_64_letters_digits_and_three_marks) {
    for (const std::string_view good : {"a", "Z", "0", "_", "-", ".", "car1", "Car-1_b.c", "..", "self"}) {
        BOOST_TEST(cles::protocol::is_name(good), "'" << good << "' is a name");
    }
    BOOST_TEST(cles::protocol::is_name(std::string(64, 'a')));
    BOOST_TEST(!cles::protocol::is_name(std::string(65, 'a')));
    for (const std::string_view bad : {"", " ", "a b", "a/b", "a:b", "a~", "a+", "a%41", "\xC3\xA4", "a\tb", "a\r"}) {
        BOOST_TEST(!cles::protocol::is_name(bad), "'" << bad << "' is no name");
    }
    BOOST_TEST(!cles::protocol::is_name(std::string_view("a\0b", 3)));
}

BOOST_AUTO_TEST_CASE(names_are_case_sensitive_and_so_are_the_reserved_targets) {
    for (const std::string_view reserved : {"self", "any", "all"}) {
        BOOST_TEST(cles::protocol::is_reserved_target(reserved));
    }
    for (const std::string_view free : {"Self", "ANY", "All", "selfish", ""}) {
        BOOST_TEST(!cles::protocol::is_reserved_target(free));
    }
}

BOOST_AUTO_TEST_CASE(a_number_is_0_or_digits_without_a_leading_zero) {
    using cles::protocol::parse_number;
    BOOST_TEST(parse_number("0").value() == 0U);
    BOOST_TEST(parse_number("7").value() == 7U);
    BOOST_TEST(parse_number("86400000").value() == 86'400'000U);
    BOOST_TEST(parse_number("18446744073709551615").value() == 18'446'744'073'709'551'615U);
    for (const std::string_view bad : {"", "00", "07", "-1", "+1", "1.0", "1e3", "0x10", " 1", "1 ", "a", "1a",
                                       "18446744073709551616", "99999999999999999999999"}) {
        BOOST_TEST(!parse_number(bad).has_value(), "'" << bad << "' is no number");
    }
}

BOOST_AUTO_TEST_CASE(every_sentence_of_the_papers_grammar_is_a_noun) {
    const auto noun = parse("device1:systemTime/UTC");
    BOOST_REQUIRE(noun.ok);
    BOOST_TEST(noun.noun.target == "device1");
    BOOST_TEST(noun.noun.task == "systemTime");
    BOOST_TEST(noun.noun.path == "systemTime/UTC");
    BOOST_REQUIRE_EQUAL(noun.noun.parameters.size(), 1U);
    BOOST_TEST(noun.noun.parameters[0] == "UTC");
    BOOST_TEST(parse("0:1/2/3/a/B").noun.parameters.size() == 4U);
}

BOOST_AUTO_TEST_CASE(a_task_needs_no_parameters) {
    const auto noun = parse("car1:speed");
    BOOST_REQUIRE(noun.ok);
    BOOST_TEST(noun.noun.parameters.empty());
    BOOST_TEST(noun.noun.path == "speed");
}

BOOST_AUTO_TEST_CASE(an_invalid_noun_is_refused_with_the_wrong_part) {
    struct example {
        std::string text;
        std::string_view names;
    };
    const example examples[] = {
        {"car1", "':'"},
        {":speed", "target ''"},
        {"car1:", "task ''"},
        {"car 1:speed", "'car 1'"},
        {"c\xC3\xA4r:speed", "target"},
        {"car1:sp~eed", "'sp~eed'"},
        {"car1:a:b", "'a:b'"},
        {std::string(65, 't') + ":speed", "target"},
        {"car1:" + std::string(65, 't'), "task"},
        {"car1:speed/a b", "'a b'"},
        {"car1:speed/a/b*c", "parameter 2"},
        {"car1:speed/\xC3\xA4", "parameter 1"},
    };
    for (const auto& e : examples) {
        const auto noun = parse(e.text);
        BOOST_TEST(!noun.ok, e.text);
        BOOST_TEST(noun.why.find(e.names) != std::string::npos, e.text << " gives: " << noun.why);
    }
}

BOOST_AUTO_TEST_CASE(an_empty_parameter_or_a_trailing_slash_is_refused) {
    for (const std::string_view bad : {"car1:speed/", "car1:speed//", "car1:speed//a", "car1:speed/a/", "car1:/a"}) {
        BOOST_TEST(!parse(bad).ok, bad);
    }
    BOOST_TEST(parse("car1:speed/a/").why == "parameter 2 is empty");
}

BOOST_AUTO_TEST_CASE(at_most_32_parameters) {
    const auto most = parse("car1:speed" + repeated("/p", 32));
    BOOST_REQUIRE(most.ok);
    BOOST_TEST(most.noun.parameters.size() == 32U);
    const auto more = parse("car1:speed" + repeated("/p", 33));
    BOOST_TEST(!more.ok);
    BOOST_TEST(more.why.find("32") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_parameter_may_be_longer_than_a_name) {
    BOOST_TEST(parse("car1:speed/" + std::string(5000, 'p')).ok);
}

BOOST_AUTO_TEST_CASE(a_parameter_allows_more_characters_than_a_name) {
    BOOST_TEST(cles::protocol::is_parameter("aZ09_-.~+"));
    for (const std::string_view bad : {"", "a b", "a=b", "a,b", "a:b", "a&b", "a?", "\"", "{", "\xC3\xA4", "\x7F"}) {
        BOOST_TEST(!cles::protocol::is_parameter(bad), "'" << bad << "' is no parameter");
    }
}

BOOST_AUTO_TEST_CASE(parameters_are_percent_decoded_to_utf8) {
    BOOST_TEST(decoded("a%20b") == "a b");
    BOOST_TEST(decoded("%C3%A4%c3%a4") == "\xC3\xA4\xC3\xA4");
    BOOST_TEST(decoded("%2F%25") == "/%");
    BOOST_TEST(decoded("1+1") == "1+1"); // '+' is not a space
    BOOST_TEST(decoded("%E2%82%AC") == "\xE2\x82\xAC");
}

BOOST_AUTO_TEST_CASE(an_escape_has_two_hex_digits) {
    for (const std::string_view bad : {"%", "%4", "a%", "a%4", "%G0", "%0g", "%%41", "%-1"}) {
        BOOST_TEST(!cles::protocol::is_parameter(bad), bad);
    }
    BOOST_TEST(cles::protocol::is_parameter("%41"));
    BOOST_TEST(cles::protocol::is_parameter("%4a"));
}

BOOST_AUTO_TEST_CASE(a_decoded_control_character_is_refused) {
    for (const std::string_view bad : {"%00", "a%0Ab", "%1F", "%7F", "%09", "%C2%80", "%C2%9f"}) {
        BOOST_TEST(!cles::protocol::is_parameter(bad), bad);
    }
    BOOST_TEST(cles::protocol::is_parameter("%20"));
    BOOST_TEST(cles::protocol::is_parameter("%C2%A0")); // a no-break space is not a control character
}

BOOST_AUTO_TEST_CASE(escapes_that_do_not_decode_to_utf8_are_refused) {
    for (const std::string_view bad : {"%FF", "%C3", "%C3x", "%80", "%C0%80", "%ED%A0%80", "%F5%80%80%80"}) {
        BOOST_TEST(!cles::protocol::is_parameter(bad), bad);
    }
}

BOOST_AUTO_TEST_CASE(allowed_characters_are_written_plain_and_others_as_upper_case_escapes) {
    BOOST_TEST(encoded("aZ09_-.~+") == "aZ09_-.~+");
    BOOST_TEST(encoded("a b/%\xC3\xA4") == "a%20b%2F%25%C3%A4");
    for (int c = 0x20; c < 0x7F; ++c) {
        const std::string text(1, static_cast<char>(c));
        BOOST_TEST(decoded(encoded(text)) == text);
        BOOST_TEST(cles::protocol::is_parameter(encoded(text)), "'" << text << "' as " << encoded(text));
    }
}

BOOST_AUTO_TEST_CASE(programs_can_encode_a_parameter) {
    BOOST_TEST(cles::encode_parameter("front-left_2.~+") == "front-left_2.~+");
    BOOST_TEST(cles::encode_parameter("a b/c%") == "a%20b%2Fc%25");
    BOOST_TEST(cles::encode_parameter("é") == "%C3%A9");
    for (const std::string_view refused : {"", "a\nb", "a\x7f", "\xFF"}) {
        BOOST_CHECK_EXCEPTION(cles::encode_parameter(refused), cles::error,
                              [](const cles::error& e) { return e.code() == cles::errc::invalid_name; });
    }
}

BOOST_AUTO_TEST_CASE(nouns_are_compared_decoded) {
    BOOST_TEST(canonical("car1:log/a%41") == "log/aA");
    BOOST_TEST(canonical("car1:log/a%41/%2f") == "log/aA/%2F");
    BOOST_TEST(canonical("car1:log/%c3%a4") == canonical("car1:log/%C3%A4"));
    BOOST_TEST(canonical("car1:log/a%2Fb") != canonical("car1:log/a/b"));
    BOOST_TEST(canonical("car1:log/aA") == "log/aA");
    BOOST_TEST(canonical("car1:log") == "log");
}

BOOST_AUTO_TEST_CASE(text_from_a_peer_is_quoted_with_a_limited_length) {
    BOOST_TEST(cles::protocol::quoted("abc") == "'abc'");
    BOOST_TEST(cles::protocol::quoted(std::string(10'000, 'x')).size() < 100U);
}

BOOST_AUTO_TEST_CASE(quoted_text_is_printable_and_short) {
    BOOST_TEST(cles::protocol::quoted("a\x1b\xc2\x9b\xe2\x80\xae\xff") == "'a\\u001b\\u009b\\u202e\xef\xbf\xbd'");
    const std::string longest(46, 'x');
    BOOST_TEST(cles::protocol::quoted(longest + "\xe2\x82\xac") == "'" + longest + "...'"); // no part of a character
    BOOST_TEST(cles::protocol::quoted(longest + "yz") == "'" + longest + "yz'");
}

BOOST_AUTO_TEST_SUITE_END()
