// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "protocol/reply_line.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>

namespace reply_line {
namespace {

using cles::errc;

struct parsed {
    bool ok = false;
    cles::protocol::reply_line line;
};

parsed parse(std::string_view text) {
    parsed result;
    result.ok = cles::protocol::parse_reply(text, result.line);
    return result;
}

std::string written(const cles::protocol::failure& why) {
    std::string out;
    cles::protocol::append_failure(out, why);
    return out;
}

} // namespace
} // namespace reply_line

BOOST_AUTO_TEST_SUITE(reply_line)

BOOST_AUTO_TEST_CASE(a_mark_names_the_update_of_a_value) {
    const auto marked = parse("id=5 seq=2 epoch=5f3a09c1 {\"x\":1}");
    BOOST_TEST_REQUIRE(marked.ok);
    BOOST_TEST((marked.line.mark == cles::update_mark{.seq = 2, .epoch = 0x5f3a09c1}));
    BOOST_TEST(marked.line.body == "{\"x\":1}");
    BOOST_TEST(cles::protocol::mark_text(marked.line.mark) == "seq=2 epoch=5f3a09c1");
    // Half a mark, or a malformed one, is ignored like an unknown adverb.
    for (const std::string_view text : {"id=5 {}", "id=5 seq=2 {}", "id=5 epoch=5f3a09c1 {}",
                                        "id=5 seq=0 epoch=5f3a09c1 {}", "id=5 seq=2 epoch=5F3A09C1 {}"}) {
        const auto other = parse(text);
        BOOST_TEST_REQUIRE(other.ok, text);
        BOOST_TEST(!other.line.mark, text);
    }
}

BOOST_AUTO_TEST_CASE(a_line_that_begins_with_id_or_a_bracket_is_a_reply) {
    for (const std::string_view reply : {"{}", "[1]", "id=7 {}", "id=", "id=x", "{", "["}) {
        BOOST_TEST(cles::protocol::is_reply(reply), reply);
    }
    for (const std::string_view request : {"PULL a:b", "ID=7 {}", "id 7", "", "\"x\"", "7", "identity=7"}) {
        BOOST_TEST(!cles::protocol::is_reply(request), request);
    }
}

BOOST_AUTO_TEST_CASE(a_reply_may_have_no_id) {
    const auto p = parse("{\"speed\":3}");
    BOOST_TEST(p.ok);
    BOOST_TEST(p.line.id == 0U);
    BOOST_TEST(p.line.body == "{\"speed\":3}");
    BOOST_TEST(parse("[1]").line.body == "[1]");
}

BOOST_AUTO_TEST_CASE(a_reply_has_its_id_progress_and_body) {
    const auto p = parse("id=7 {\"speed\":3}");
    BOOST_REQUIRE(p.ok);
    BOOST_TEST(p.line.id == 7U);
    BOOST_TEST(!p.line.progress.has_value());
    BOOST_TEST(p.line.body == "{\"speed\":3}");

    const auto interim = parse("id=9223372036854775807  progress=0.4   {\"at\":\"x\"}");
    BOOST_REQUIRE(interim.ok);
    BOOST_TEST(interim.line.id == 9'223'372'036'854'775'807U);
    BOOST_TEST(interim.line.progress.value() == 0.4);
    BOOST_TEST(interim.line.body == "{\"at\":\"x\"}");
}

BOOST_AUTO_TEST_CASE(progress_is_a_number_from_0_to_1) {
    for (const std::string_view good : {"0", "1", "0.0", "0.4", "1.0", "4e-1"}) {
        BOOST_TEST(parse("id=7 progress=" + std::string{good} + " {}").ok, good);
    }
    for (const std::string_view bad : {"1.1", "-0.1", "2", "nan", "inf", "x", "0.4x", "+0.4", "1e400"}) {
        BOOST_TEST(!parse("id=7 progress=" + std::string{bad} + " {}").ok, bad);
    }
}

BOOST_AUTO_TEST_CASE(unknown_adverbs_of_a_reply_are_ignored) {
    const auto p = parse("id=7 colour=red {}");
    BOOST_TEST(p.ok);
    BOOST_TEST(p.line.body == "{}");
}

BOOST_AUTO_TEST_CASE(a_malformed_reply_is_recognised) {
    for (const std::string_view bad : {"id=", "id=0 {}", "id=07 {}", "id=-1 {}", "id=x {}", "id=9223372036854775808 {}",
                                       "id=7", "id=7 5", "id=7 \"x\"", "id=7 null", "id=7{}", "id=7 progress {}",
                                       "id=7 progress=0.1 progress=0.1 {}", "id=7 id=7 {}", "id=7\t{}"}) {
        BOOST_TEST(!parse(bad).ok, bad);
    }
}

BOOST_AUTO_TEST_CASE(a_failure_begins_with_exactly_these_characters) {
    BOOST_TEST(cles::protocol::is_failure("{\"error\":\"busy\"}"));
    for (const std::string_view success :
         {"{ \"error\":\"busy\"}", "{\"error\": \"busy\"}", "{\"error\":5}", "{}", "{\"Error\":\"busy\"}",
          "[{\"error\":\"busy\"}]", "{\"a\":1,\"error\":\"busy\"}"}) {
        BOOST_TEST(!cles::protocol::is_failure(success), success);
    }
}

BOOST_AUTO_TEST_CASE(every_code_of_the_table_crosses_the_wire_by_its_name) {
    struct example {
        errc code;
        std::string_view name;
    };
    const example examples[] = {
        {errc::bad_request, "bad_request"}, {errc::denied, "denied"},           {errc::no_target, "no_target"},
        {errc::no_task, "no_task"},         {errc::too_large, "too_large"},     {errc::cancelled, "cancelled"},
        {errc::failed, "failed"},           {errc::unavailable, "unavailable"}, {errc::busy, "busy"},
        {errc::deadline, "deadline"},
    };
    for (const auto& e : examples) {
        const auto text = written({.code = e.code, .message = "why"});
        BOOST_TEST(text.starts_with("{\"error\":\"" + std::string{e.name} + "\",\"message\":\"why\""), text);
        cles::protocol::failure back;
        BOOST_TEST(cles::protocol::parse_failure(text, back));
        BOOST_CHECK(back.code == e.code);
        BOOST_TEST(back.message == "why");
    }
}

BOOST_AUTO_TEST_CASE(an_unknown_code_counts_as_failed) {
    cles::protocol::failure f;
    BOOST_TEST(cles::protocol::parse_failure("{\"error\":\"overheated\",\"message\":\"99 degrees\"}", f));
    BOOST_CHECK(f.code == errc::failed);
    BOOST_TEST(f.message == "99 degrees");
}

BOOST_AUTO_TEST_CASE(more_keys_may_follow_in_a_failure) {
    cles::protocol::failure f;
    BOOST_TEST(cles::protocol::parse_failure(
        "{\"error\":\"busy\",\"since\":[1,{\"a\":null}],\"message\":\"full \\u00e4\",\"retry_ms\":250,\"ran\":true}",
        f));
    BOOST_CHECK(f.code == errc::busy);
    BOOST_TEST(f.message == "full \xC3\xA4");
    BOOST_TEST(f.retry_ms.value() == 250U);
    BOOST_TEST(f.ran);
}

BOOST_AUTO_TEST_CASE(keys_of_another_kind_in_a_failure_are_ignored) {
    cles::protocol::failure f;
    BOOST_TEST(cles::protocol::parse_failure("{\"error\":\"busy\",\"message\":5,\"retry_ms\":\"x\",\"ran\":null}", f));
    BOOST_CHECK(f.code == errc::busy);
    BOOST_TEST(f.message.empty());
    BOOST_TEST(!f.retry_ms.has_value());
    BOOST_TEST(!f.ran);
}

BOOST_AUTO_TEST_CASE(a_failure_that_is_not_json_is_recognised) {
    cles::protocol::failure f;
    for (const std::string_view bad :
         {"{\"error\":\"busy\"", "{\"error\":\"busy\"} x", "{\"error\":\"busy\",}", "{\"error\":\"bu\xFFsy\"}",
          "{\"error\":\"", "{\"error\":\"busy\" \"message\":1}"}) {
        BOOST_TEST(!cles::protocol::parse_failure(bad, f), bad);
    }
}

BOOST_AUTO_TEST_CASE(busy_has_a_retry_time_and_too_large_says_whether_the_handler_ran) {
    BOOST_TEST(written({.code = errc::busy, .message = "full", .retry_ms = 250}) ==
               "{\"error\":\"busy\",\"message\":\"full\",\"retry_ms\":250}");
    BOOST_TEST(written({.code = errc::too_large, .message = "big", .ran = true}) ==
               "{\"error\":\"too_large\",\"message\":\"big\",\"ran\":true}");
    BOOST_TEST(written({.code = errc::too_large, .message = "big"}) == "{\"error\":\"too_large\",\"message\":\"big\"}");
}

BOOST_AUTO_TEST_CASE(busy_has_a_default_retry_time) {
    cles::protocol::failure f;
    BOOST_TEST(cles::protocol::parse_failure(written({.code = errc::busy, .message = "full"}), f));
    BOOST_TEST(f.retry_ms.value_or(0) > 0U);
}

BOOST_AUTO_TEST_CASE(any_message_stays_valid_json) {
    BOOST_TEST(written({.code = errc::failed, .message = "a \"b\"\n\\ \xFF"}) ==
               "{\"error\":\"failed\",\"message\":\"a \\\"b\\\"\\n\\\\ \xEF\xBF\xBD\"}");
}

BOOST_AUTO_TEST_CASE(the_heads_of_replies_are_written) {
    std::string out;
    cles::protocol::append_reply_head(out, 0);
    BOOST_TEST(out.empty());
    cles::protocol::append_reply_head(out, 7);
    BOOST_TEST(out == "id=7 ");
    out.clear();
    cles::protocol::append_progress_head(out, 7, 0.4);
    BOOST_TEST(out == "id=7 progress=0.4 ");
    out.clear();
    cles::protocol::append_progress_head(out, 7, 1.0);
    BOOST_TEST(parse(out + "{}").line.progress.value() == 1.0);
}

// Programs show it, in `what()` for example.
BOOST_AUTO_TEST_CASE(the_message_of_a_failure_is_printable) {
    cles::protocol::failure why;
    BOOST_TEST(cles::protocol::parse_failure(
        "{\"error\":\"denied\",\"message\":\"a\\u001b[2J\\n\xc2\x9b\xe2\x80\xae\"}", why));
    BOOST_TEST(why.message == "a\\u001b[2J\\n\\u009b\\u202e");
}

BOOST_AUTO_TEST_SUITE_END()
