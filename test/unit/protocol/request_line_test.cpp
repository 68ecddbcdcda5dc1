// SPDX-License-Identifier: BSL-1.0
#include "protocol/request_line.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace request_line {
namespace {

using cles::verb;

struct parsed {
    bool ok = false;
    cles::protocol::request_line line;
    cles::protocol::malformed_request error;
};

// `text` must outlive the result.
parsed parse(std::string_view text) {
    parsed result;
    result.ok = cles::protocol::parse_request(text, result.line, result.error);
    return result;
}

std::string why(std::string_view text) {
    const auto p = parse(text);
    return p.ok ? "(taken)" : p.error.why;
}

bool names(const std::string& message, std::string_view what) { return message.find(what) != std::string::npos; }

std::string with_adverbs(std::string_view head, std::size_t count) {
    std::string text{head};
    for (std::size_t i = 0; i < count; ++i) {
        text += " x_";
        text += static_cast<char>('a' + i % 26);
        text += "=1";
    }
    return text;
}

std::string written(const cles::protocol::outgoing_request& request) {
    std::string out;
    cles::protocol::append_request(out, request);
    return out;
}

} // namespace
} // namespace request_line

BOOST_AUTO_TEST_SUITE(request_line)

BOOST_AUTO_TEST_SUITE(verbs)

BOOST_AUTO_TEST_CASE(there_are_five_verbs_in_any_case) {
    struct example {
        std::string_view text;
        verb expected;
    };
    const example examples[] = {
        {"PULL a:b", verb::pull},         {"pull a:b", verb::pull},     {"Pull a:b", verb::pull},
        {"PUSH a:b", verb::push},         {"pUsH a:b", verb::push},     {"DELEGATE a:b", verb::delegate},
        {"delegate a:b", verb::delegate}, {"BIND a:b", verb::bind},     {"bind a:b", verb::bind},
        {"UPDATE a:b", verb::update},     {"uPDATE a:b", verb::update},
    };
    for (const auto& e : examples) {
        const auto p = parse(e.text);
        BOOST_TEST(p.ok, e.text);
        BOOST_TEST((p.line.verb == e.expected), e.text);
    }
}

BOOST_AUTO_TEST_CASE(a_sixth_verb_is_refused_by_name) {
    for (const std::string_view bad :
         {"GET a:b", "PUL a:b", "PULLS a:b", "PULL\ta:b", "a:b", "PULLa:b", "P\xC3\x9CLL a:b"}) {
        BOOST_TEST(names(why(bad), "is not a verb"), bad);
    }
    BOOST_TEST(names(why("GET a:b"), "'GET'"));
}

BOOST_AUTO_TEST_CASE(a_verb_needs_a_noun) {
    BOOST_TEST(why("PULL") == "PULL without a noun (target:task)");
    BOOST_TEST(why("PUSH {\"a\":1}") == "PUSH without a noun (target:task)");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(parts)

BOOST_AUTO_TEST_CASE(one_sp_or_more_separates_parts) {
    const auto p = parse("PUSH   car1:log/a    id=7     deadline=9   {\"a\": 1}");
    BOOST_REQUIRE(p.ok);
    BOOST_TEST(p.line.noun.path == "log/a");
    BOOST_TEST(p.line.id == 7U);
    BOOST_TEST(p.line.deadline_ms == 9U);
    BOOST_TEST(p.line.body == "{\"a\": 1}");
}

BOOST_AUTO_TEST_CASE(tab_does_not_separate_parts) {
    for (const std::string_view bad :
         {"PULL\tcar1:speed", "PULL car1:speed\tid=7", "PULL car1:speed id=7\tdeadline=9"}) {
        BOOST_TEST(!parse(bad).ok, bad);
    }
}

BOOST_AUTO_TEST_CASE(the_body_begins_at_the_first_part_that_begins_with_a_bracket) {
    BOOST_TEST(parse("PUSH a:b {\"k\":\"id=7 {\"}").line.body == "{\"k\":\"id=7 {\"}");
    BOOST_TEST(parse("PUSH a:b {\"k\":\"id=7 {\"}").line.id == 0U);
    BOOST_TEST(parse("PUSH a:b [1, 2]").line.body == "[1, 2]");
    BOOST_TEST(parse("PUSH a:b id=7 [1] id=8").line.body == "[1] id=8");
    BOOST_TEST(parse("PUSH a:b").line.body.empty());
    BOOST_TEST(parse("PUSH a:b x=a{b").line.body.empty()); // inside a part, a bracket is an ordinary character
}

BOOST_AUTO_TEST_CASE(a_part_that_is_neither_adverb_nor_body_is_refused_by_name) {
    for (const std::string_view bad :
         {"PUSH a:b 5", "PUSH a:b \"text\"", "PULL a:b c:d", "PULL a:b =7", "PULL a:b id=", "PULL a:b Id=7",
          "PULL a:b i-d=7", "PULL a:b 1d=7", "PULL a:b x=\x7F", "PULL a:b x=\xC3\xA4", "PULL a:b x=a\x01"}) {
        BOOST_TEST(names(why(bad), "neither an adverb"), bad << " gives: " << why(bad));
    }
    BOOST_TEST(names(why("PUSH a:b null"), "'null'"));
}

BOOST_AUTO_TEST_CASE(an_adverbs_value_is_any_visible_ascii) {
    BOOST_TEST(parse("PULL a:b note=!\"#$%&'()*+,-./:;<=>?@[]^`{|}~").ok);
}

BOOST_AUTO_TEST_CASE(at_most_16_adverbs) {
    BOOST_TEST(parse(with_adverbs("PULL a:b", 16)).ok);
    BOOST_TEST(why(with_adverbs("PULL a:b", 17)) == "more than 16 adverbs");
    BOOST_TEST(why(with_adverbs("PULL a:b id=7", 16)) == "more than 16 adverbs");
}

BOOST_AUTO_TEST_CASE(pull_and_bind_take_no_body) {
    for (const std::string_view bad : {"PULL a:b {}", "PULL a:b {\"a\":1}", "BIND a:b []", "BIND a:b every=9 {}"}) {
        BOOST_TEST(names(why(bad), "takes no body"), bad);
    }
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(adverbs)

BOOST_AUTO_TEST_CASE(absent_adverbs_hold_their_defaults) {
    const auto p = parse("BIND a:b");
    BOOST_TEST(p.line.id == 0U);
    BOOST_TEST(p.line.wants_reply);
    BOOST_TEST(!p.line.wants_progress);
    BOOST_TEST(p.line.hops == 8);
    BOOST_TEST(!p.line.lease_ms.has_value());
    BOOST_TEST(p.line.every_ms == 0U);
    BOOST_TEST(p.line.keep == 64U);
    BOOST_TEST(!p.line.is_update());
    BOOST_TEST(!p.line.unbinds());
    BOOST_TEST(p.line.via.empty());
}

BOOST_AUTO_TEST_CASE(the_default_deadline_is_5_s_and_30_s_for_delegate) {
    for (const std::string_view text : {"PULL a:b", "PUSH a:b", "BIND a:b", "UPDATE a:b"}) {
        BOOST_TEST(parse(text).line.deadline_ms == 5000U, text);
    }
    BOOST_TEST(parse("DELEGATE a:b").line.deadline_ms == 30'000U);
    BOOST_TEST(parse("DELEGATE a:b deadline=7").line.deadline_ms == 7U);
}

BOOST_AUTO_TEST_CASE(known_adverbs_are_accepted_within_their_bounds) {
    const std::string max_since(64, 'x');
    const std::string too_long_since(65, 'x');
    struct example {
        std::string_view verb_and_noun;
        std::string_view key;
        std::vector<std::string_view> good;
        std::vector<std::string_view> bad;
    };
    const example examples[] = {
        {"PULL a:b",
         "id",
         {"1", "7", "9223372036854775807"},
         {"0", "-1", "01", "x", "9223372036854775808", "1.5", "7,8"}},
        {"PULL a:b", "deadline", {"1", "86400000"}, {"0", "86400001", "1s", "-5", "0100"}},
        {"PUSH a:b", "reply", {"no"}, {"yes", "NO", "0", "No"}},
        {"UPDATE a:b", "reply", {"no"}, {"yes"}},
        {"PULL a:b", "hops", {"0", "8", "16"}, {"17", "-1", "00", "x"}},
        {"DELEGATE a:b id=7", "progress", {"yes"}, {"no", "Yes", "1"}},
        {"PULL a:b id=7", "urgent", {"yes"}, {"no", "Yes", "1"}},
        {"BIND a:b",
         "lease",
         {"0", "1", "60000", "60001", "18446744073709551615", "99999999999999999999999"},
         {"-1", "x", "010", "1e3"}},
        {"BIND a:b", "every", {"1", "86400000"}, {"0", "86400001", "x"}},
        {"BIND a:b", "keep", {"1", "65536"}, {"0", "65537", "x"}},
        {"UPDATE a:b epoch=5f3a09c1", "seq", {"1", "9223372036854775807"}, {"0", "-1", "x", "9223372036854775808"}},
        {"UPDATE a:b seq=1",
         "epoch",
         {"00000000", "5f3a09c1", "ffffffff"},
         {"5F3A09C1", "5f3a09c", "5f3a09c11", "5f3a09cg"}},
        {"PULL a:b", "since", {"0", "5f3a09c1.42", max_since}, {too_long_since}},
        {"PULL a:b",
         "routes",
         {"1.car1", "16.a"},
         {"0.car1", "17.car1", "1", "1.", ".car1", "a.car1", "1.a,b", "001.car1"}},
        {"PULL a:b", "describe", {"5f3a09c1", "5f3a09c1,00000000"}, {"5f3a09c1,", ",5f3a09c1", "5F3A09C1", "1", "x"}},
        {"PULL a:b", "via", {"car1", "car1,car2,x.y-z_0"}, {",", "car1,", ",car1", "car1,,car2", "c%r", "c~r"}},
    };
    for (const auto& e : examples) {
        const auto base = std::string{e.verb_and_noun} + " " + std::string{e.key} + "=";
        for (const auto value : e.good) {
            const auto text = base + std::string{value};
            BOOST_TEST(parse(text).ok, text << ": " << why(text));
        }
        for (const auto value : e.bad) {
            const auto text = base + std::string{value};
            BOOST_TEST(names(why(text), "'" + std::string{e.key} + "' has the bad value"), text << ": " << why(text));
        }
    }
}

BOOST_AUTO_TEST_CASE(the_values_of_adverbs_are_parsed) {
    const auto p =
        parse("DELEGATE a:b id=9223372036854775807 deadline=86400000 hops=0 progress=yes via=car1,car2 {\"x\":1}");
    BOOST_REQUIRE(p.ok);
    BOOST_TEST(p.line.id == 9'223'372'036'854'775'807U);
    BOOST_TEST(p.line.deadline_ms == 86'400'000U);
    BOOST_TEST(p.line.hops == 0);
    BOOST_TEST(p.line.wants_progress);
    BOOST_TEST(p.line.via == "car1,car2");

    const auto b = parse("BIND a:b lease=200 every=20 keep=65536");
    BOOST_TEST(b.line.lease_ms.value() == 200U);
    BOOST_TEST(b.line.every_ms == 20U);
    BOOST_TEST(b.line.keep == 65'536U);

    const auto u = parse("UPDATE a:b reply=no");
    BOOST_TEST(!u.line.wants_reply);
}

BOOST_AUTO_TEST_CASE(a_lease_of_more_than_60000_counts_as_60000) {
    BOOST_TEST(parse("BIND a:b lease=60000").line.lease_ms.value() == 60'000U);
    BOOST_TEST(parse("BIND a:b lease=60001").line.lease_ms.value() == 60'000U);
    BOOST_TEST(parse("BIND a:b lease=4294967297").line.lease_ms.value() == 60'000U);
}

BOOST_AUTO_TEST_CASE(a_lease_of_0_unbinds) {
    BOOST_TEST(parse("BIND a:b lease=0").line.unbinds());
    BOOST_TEST(!parse("BIND a:b lease=1").line.unbinds());
}

BOOST_AUTO_TEST_CASE(a_known_adverb_twice_is_refused) {
    for (const std::string_view bad :
         {"PULL a:b id=7 id=7", "PULL a:b id=7 id=8", "PULL a:b deadline=1 deadline=1", "PUSH a:b reply=no reply=no",
          "PULL a:b hops=1 hops=2", "DELEGATE a:b progress=yes progress=yes", "BIND a:b lease=1 lease=1",
          "BIND a:b every=1 every=1", "BIND a:b keep=1 keep=1", "UPDATE a:b seq=1 seq=1 epoch=00000000",
          "UPDATE a:b seq=1 epoch=00000000 epoch=00000000", "PULL a:b via=a via=b", "PULL a:b since=0 since=0"}) {
        BOOST_TEST(names(why(bad), "occurs twice"), bad << " gives: " << why(bad));
    }
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_ignored_however_often_they_occur) {
    BOOST_TEST(parse("PULL a:b colour=red colour=blue sender_=x").ok);
    BOOST_TEST(parse("PULL a:b must=1 xmust_y=1").ok);
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_are_counted) {
    BOOST_TEST(parse("PULL a:b id=1 via=c").line.unknown_adverbs == 0U);
    BOOST_TEST(parse("PULL a:b colour=red id=1 colour=blue keep=1").line.unknown_adverbs == 3U); // `keep` is of BIND
}

BOOST_AUTO_TEST_CASE(an_unknown_adverb_that_begins_with_must_is_refused) {
    for (const std::string_view bad : {"PULL a:b must_sign=yes", "PULL a:b must_=1", "BIND a:b every=1 must_x=1"}) {
        BOOST_TEST(names(why(bad), "is not known here"), bad << " gives: " << why(bad));
    }
    BOOST_TEST(names(why("PULL a:b must_sign=yes"), "'must_sign'"));
}

BOOST_AUTO_TEST_CASE(a_known_adverb_is_ignored_on_a_verb_that_it_is_not_for) {
    for (const std::string_view text :
         {"PULL a:b reply=no", "DELEGATE a:b reply=no", "BIND a:b reply=no", "PULL a:b reply=maybe",
          "PUSH a:b progress=yes", "BIND a:b urgent=x", "UPDATE a:b urgent=x", "PULL a:b progress=x",
          "PULL a:b lease=x", "UPDATE a:b lease=0", "PULL a:b every=0", "PUSH a:b keep=0", "PULL a:b seq=1",
          "BIND a:b epoch=x", "PUSH a:b seq=1 seq=1", "PULL a:b every=1 every=1"}) {
        const auto p = parse(text);
        BOOST_TEST(p.ok, text << ": " << why(text));
        BOOST_TEST(p.line.wants_reply, text);
        BOOST_TEST(!p.line.wants_progress, text);
        BOOST_TEST(!p.line.is_update(), text);
        BOOST_TEST(!p.line.unbinds(), text);
    }
}

BOOST_AUTO_TEST_CASE(an_update_has_both_seq_and_epoch_and_a_request_to_publish_neither) {
    BOOST_TEST(parse("UPDATE a:b seq=1 epoch=5f3a09c1 {}").line.is_update());
    BOOST_TEST(parse("UPDATE a:b epoch=5f3a09c1 seq=1").line.is_update());
    BOOST_TEST(!parse("UPDATE a:b {}").line.is_update());
    BOOST_TEST(names(why("UPDATE a:b seq=1 {}"), "both 'seq' and 'epoch'"));
    BOOST_TEST(names(why("UPDATE a:b epoch=5f3a09c1"), "both 'seq' and 'epoch'"));
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(salvage)

BOOST_AUTO_TEST_CASE(the_id_is_salvaged_if_there_is_exactly_one_valid_id_before_the_body) {
    struct example {
        std::string_view text;
        std::uint64_t id;
    };
    const example examples[] = {
        {"FLY a:b id=7", 7},
        {"PULL id=7", 7},
        {"PULL a b id=7", 7},
        {"PULL a:b id=7 deadline=0", 7},
        {"PULL a:b deadline=0 id=7", 7},
        {"PULL a:b id=7 must_x=1", 7},
        {"PULL a:b id=7 {}", 7},
        {"PULL a:b id=7 id=x", 7},
        {"PULL a:b id=0 id=7", 7},
        {"PULL a:b id=7 id=7", 0},
        {"PULL a:b id=7 id=8", 0},
        {"PULL a:b id=0", 0},
        {"PULL a:b id=9223372036854775808", 0},
        {"PULL a:b deadline=0 {\"x\": id=7 }", 0},
        {"FLY a:b xid=7", 0},
        {"FLY a:b", 0},
    };
    for (const auto& e : examples) {
        const auto p = parse(e.text);
        BOOST_TEST(!p.ok, e.text);
        BOOST_TEST(p.error.id == e.id, e.text);
        BOOST_TEST(!p.error.why.empty());
    }
}

BOOST_AUTO_TEST_CASE(reply_no_is_salvaged_on_push_and_update_only) {
    BOOST_TEST(!parse("PUSH a:b reply=no deadline=0").error.wants_reply);
    BOOST_TEST(!parse("PUSH a:b deadline=0 reply=no").error.wants_reply);
    BOOST_TEST(!parse("UPDATE ab reply=no").error.wants_reply);
    BOOST_TEST(parse("PULL ab reply=no").error.wants_reply);
    BOOST_TEST(parse("DELEGATE ab reply=no").error.wants_reply);
    BOOST_TEST(parse("FLY a:b reply=no").error.wants_reply);
    BOOST_TEST(parse("PUSH a:b deadline=0 {\"x\": reply=no }").error.wants_reply);
}

BOOST_AUTO_TEST_CASE(a_malformed_update_with_seq_and_epoch_wants_no_reply) {
    BOOST_TEST(!parse("UPDATE ab seq=1 epoch=5f3a09c1 {}").error.wants_reply);
    BOOST_TEST(!parse("UPDATE a:b seq=1 epoch=5f3a09c1 deadline=0").error.wants_reply);
    BOOST_TEST(parse("UPDATE a:b seq=1 {}").error.wants_reply);
    BOOST_TEST(parse("UPDATE a:b seq=0 epoch=5f3a09c1 {}").error.wants_reply);
    BOOST_TEST(parse("PUSH ab seq=1 epoch=5f3a09c1 {}").error.wants_reply);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(writing)

BOOST_AUTO_TEST_CASE(requests_are_written_with_the_verb_in_capitals_and_single_spaces) {
    BOOST_TEST(written({.verb = verb::pull, .noun = "car1:speed"}) == "PULL car1:speed\n");
    BOOST_TEST(written({.verb = verb::delegate,
                        .noun = "car1:plan/a",
                        .id = 7,
                        .deadline_ms = 200,
                        .wants_progress = true,
                        .carried = {.urgent = true},
                        .body = "{\"x\":1}"}) ==
               "DELEGATE car1:plan/a id=7 deadline=200 progress=yes urgent=yes {\"x\":1}\n");
    BOOST_TEST(written({.verb = verb::bind, .noun = "car1:speed", .id = 8, .lease_ms = 0}) ==
               "BIND car1:speed id=8 lease=0\n");
    BOOST_TEST(written({.verb = verb::bind, .noun = "car1:speed", .every_ms = 20, .keep = 5, .adverbs = "via=car3"}) ==
               "BIND car1:speed every=20 keep=5 via=car3\n");
    BOOST_TEST(written({.verb = verb::push, .noun = "car1:log", .wants_reply = false, .body = "[]"}) ==
               "PUSH car1:log reply=no []\n");
}

BOOST_AUTO_TEST_CASE(a_copy_with_a_text_of_its_own_is_written_alike) {
    std::string noun = "car1:plan";
    std::string adverbs = "hops=7 via=car2";
    std::string body = "[1]";
    const cles::protocol::outgoing_request request{
        .verb = verb::delegate, .noun = noun, .id = 7, .carried = {.urgent = true}, .adverbs = adverbs, .body = body};
    const auto text = written(request);
    std::string memory = "of another request";
    const auto copy = cles::protocol::copy_text(request, memory);
    for (auto* original : {&noun, &adverbs, &body}) {
        original->assign(original->size(), '-');
    }
    BOOST_TEST(written(copy) == text);
    BOOST_TEST(text == "DELEGATE car1:plan id=7 urgent=yes hops=7 via=car2 [1]\n");
    BOOST_TEST(copy.target() == "car1");
    BOOST_TEST(copy.size() == noun.size() + adverbs.size() + body.size());
}

BOOST_AUTO_TEST_CASE(written_requests_are_parsed_back) {
    const auto text = written({.verb = verb::delegate,
                               .noun = "car1:plan/a%20b",
                               .id = 9'223'372'036'854'775'807U,
                               .deadline_ms = 86'400'000,
                               .wants_progress = true,
                               .body = "[1]"});
    const auto p = parse(std::string_view{text}.substr(0, text.size() - 1));
    BOOST_REQUIRE(p.ok);
    BOOST_CHECK(p.line.verb == verb::delegate);
    BOOST_TEST(p.line.noun.path == "plan/a%20b");
    BOOST_TEST(p.line.id == 9'223'372'036'854'775'807U);
    BOOST_TEST(p.line.deadline_ms == 86'400'000U);
    BOOST_TEST(p.line.wants_progress);
    BOOST_TEST(p.line.body == "[1]");
}

BOOST_AUTO_TEST_CASE(an_update_has_its_seq_and_epoch) {
    std::string line;
    cles::protocol::append_update_head(line, "car1", "localization/fast", 17, "5f3a09c1");
    BOOST_TEST(line == "UPDATE car1:localization/fast seq=17 epoch=5f3a09c1 ");
    line += "{\"utc\":1}";
    const auto p = parse(line);
    BOOST_TEST(p.line.is_update());
    BOOST_TEST(p.line.seq.value() == 17U);
    BOOST_TEST(p.line.epoch.value() == 0x5f3a09c1U);
}

BOOST_AUTO_TEST_CASE(an_epoch_is_8_lower_case_hex_digits) {
    BOOST_TEST(cles::protocol::epoch_text(0) == "00000000");
    BOOST_TEST(cles::protocol::epoch_text(0x5f3a09c1) == "5f3a09c1");
    BOOST_TEST(cles::protocol::epoch_text(0xFFFFFFFF) == "ffffffff");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_CASE(a_signature_of_a_request_states_how_long_its_requester_waits) {
    const auto read = cles::protocol::parse_request_signature("abc-_.30000");
    BOOST_REQUIRE(read);
    BOOST_TEST(read->signature == "abc-_");
    BOOST_TEST(read->waits_ms == 30'000U);
    BOOST_TEST(cles::protocol::request_signature_text(*read) == "abc-_.30000");
    BOOST_TEST(cles::protocol::parse_request_signature("abc.1").has_value());
    BOOST_TEST(cles::protocol::parse_request_signature("abc.86400000").has_value());
    for (const std::string_view other : {"", "abc", ".", "abc.", "abc.0", "abc.01", "abc.86400001", "abc.1.2", "abc.-1",
                                         "abc.x", "abc.99999999999999999999"}) {
        BOOST_TEST(!cles::protocol::parse_request_signature(other), other);
    }
}

BOOST_AUTO_TEST_SUITE_END()
