// SPDX-License-Identifier: BSL-1.0
// Types of the standard library in JSON, members that may be missing, and text that is not UTF-8.

#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/convert_wrapped.hpp>

#include "support/converted.hpp"

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <ratio>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

namespace standard_types {

struct pose {
    double x = 0;
    double y = 0;
};
BOOST_DESCRIBE_STRUCT(pose, (), (x, y))

struct reading {
    double value = 0;
};
BOOST_DESCRIBE_STRUCT(reading, (), (value))

struct outer {
    reading value;
};
BOOST_DESCRIBE_STRUCT(outer, (), (value))

struct stamped {
    std::int64_t utc = 7;
    double quality = 0.5;
};
BOOST_DESCRIBE_STRUCT(stamped, (), (utc, quality))
CLES_DEFAULTS(stamped, (quality))

struct position : stamped {
    double lat = 0;
    double heading = 90;
    std::vector<int> lanes{1};
};
BOOST_DESCRIBE_STRUCT(position, (stamped), (lat, heading, lanes))
CLES_DEFAULTS(position, (heading, lanes))

class inside {
  public:
    int old = 1;
    int added = 2;

  private:
    BOOST_DESCRIBE_CLASS(inside, (), (old, added), (), ())
    friend CLES_DEFAULTS(inside, (added))
};

struct note {
    std::string text{};
    std::vector<std::map<std::string, std::string>> more{};
};
BOOST_DESCRIBE_STRUCT(note, (), (text, more))

struct celsius {
    double degrees = 0;
};

} // namespace standard_types

template <>
struct cles::converter<standard_types::celsius> {
    static constexpr bool is_scalar = true;
    static void write(json_writer& w, const standard_types::celsius& value) { w.value(value.degrees); }
    static bool read(json_reader& r, standard_types::celsius& value) { return r.read(value.degrees); }
};

namespace convert_standard {
namespace {

using namespace standard_types;
using namespace std::chrono_literals;
using cles::from_json;
using cles::to_json;
using cles::test::round_trip;
using cles::test::why;
namespace chrono = std::chrono;

/// As a body or a result is sent.
template <class T>
T round_trip_as_body(const T& value) {
    return from_json<cles::detail::wrapped<T>>(cles::detail::to_body(value)).value;
}

template <class F>
std::string conversion_error(F f) {
    try {
        f();
    } catch (const cles::error& e) {
        return e.code() == cles::errc::conversion ? e.message() : e.what();
    }
    return "(none)";
}

} // namespace
} // namespace convert_standard

BOOST_AUTO_TEST_SUITE(convert_standard)

BOOST_AUTO_TEST_SUITE(times)

BOOST_AUTO_TEST_CASE(durations_are_written_as_iso_8601) {
    BOOST_TEST(to_json(90s) == "\"PT90S\"");
    BOOST_TEST(to_json(1500ms) == "\"PT1.5S\"");
    BOOST_TEST(to_json(0ns) == "\"PT0S\"");
    BOOST_TEST(to_json(1ns) == "\"PT0.000000001S\"");
    BOOST_TEST(to_json(-1500ms) == "\"-PT1.5S\"");
    BOOST_TEST(to_json(-1ms) == "\"-PT0.001S\"");
    BOOST_TEST(to_json(-2s) == "\"-PT2S\"");
    BOOST_TEST(to_json(48h) == "\"PT172800S\"");
    BOOST_TEST(to_json(chrono::duration<int, std::ratio<1, 3>>{1}) == "\"PT0.333333333S\"");
    BOOST_TEST(to_json(chrono::duration<double>{0.1}) == "\"PT0.1S\"");
    BOOST_TEST(to_json(chrono::duration<double, std::milli>{-250}) == "\"-PT0.25S\"");
    BOOST_TEST(to_json(chrono::duration<double>{std::numeric_limits<double>::infinity()}) == "null");
    BOOST_TEST(to_json(chrono::milliseconds::max()) == "\"PT9223372036854775.807S\"");
}

BOOST_AUTO_TEST_CASE(durations_are_read_from_iso_8601_and_from_seconds) {
    BOOST_TEST((from_json<chrono::milliseconds>("\"PT1.5S\"") == 1500ms));
    BOOST_TEST((from_json<chrono::milliseconds>("\"PT1,5S\"") == 1500ms));
    BOOST_TEST((from_json<chrono::milliseconds>("\"-PT1.5S\"") == -1500ms));
    BOOST_TEST((from_json<chrono::milliseconds>("\"PT-1.5S\"") == -1500ms));
    BOOST_TEST((from_json<chrono::seconds>("\"P1DT2H3M4S\"") == 24h + 2h + 3min + 4s));
    BOOST_TEST((from_json<chrono::seconds>("\"P2W\"") == 14 * 24h));
    BOOST_TEST((from_json<chrono::seconds>("\"PT0.5M\"") == 30s));
    BOOST_TEST((from_json<chrono::milliseconds>("1.5") == 1500ms));
    BOOST_TEST((from_json<chrono::milliseconds>("-1.5") == -1500ms));
    BOOST_TEST((from_json<chrono::milliseconds>("15e-1") == 1500ms));
    BOOST_TEST((from_json<chrono::nanoseconds>("1700000000.123456789") == 1700000000123456789ns));
    BOOST_TEST((from_json<chrono::duration<double>>("\"PT0.1S\"").count() == 0.1));
    BOOST_TEST((from_json<chrono::duration<double>>("\"PT1M0.5S\"").count() == 60.5));
    BOOST_TEST((from_json<chrono::duration<double>>("2.5").count() == 2.5));
    BOOST_TEST(std::isnan(from_json<chrono::duration<double>>("null").count()));
}

BOOST_AUTO_TEST_CASE(finer_fractions_are_rounded_down) {
    BOOST_TEST((from_json<chrono::seconds>("\"PT1.999S\"") == 1s));
    BOOST_TEST((from_json<chrono::seconds>("\"-PT1.5S\"") == -2s));
    BOOST_TEST((from_json<chrono::hours>("\"PT119M\"") == 1h));
}

BOOST_AUTO_TEST_CASE(an_invalid_duration_is_an_error) {
    const std::string expected = "expected a duration as \"PT1.5S\" or a number of seconds";
    for (const std::string_view text :
         {"\"\"", "\"P\"", "\"PT\"", "\"P1DT\"", "\"1s\"", "\"PT1\"", "\"PT1SX\"", "\"P1S\"", "\"PT1D\"", "\"PTS\"",
          "\"PT1.S\"", "true", "{}", "\"PT99999999999999999999S\""}) {
        BOOST_TEST(why<chrono::milliseconds>(text) == expected, text);
        if (!text.starts_with("\"PT9")) { // which fit into a double
            BOOST_TEST(why<chrono::duration<double>>(text) == expected, text);
        }
    }
    BOOST_TEST(why<chrono::seconds>("\"P1Y\"") ==
               "expected a duration without years and months, which have no fixed length");
    BOOST_TEST(why<chrono::seconds>("\"P1M\"") ==
               "expected a duration without years and months, which have no fixed length");
    BOOST_TEST(why<chrono::nanoseconds>("\"PT10000000000S\"") == "a time out of range");
    BOOST_TEST(why<chrono::nanoseconds>("1e30") == "a time out of range");
    BOOST_TEST((why<chrono::duration<std::int8_t>>("128") == "a time out of range"));
    BOOST_TEST(conversion_error([] { to_json(chrono::hours::max()); }) == "a time out of range");
}

BOOST_AUTO_TEST_CASE(a_duration_of_any_length_of_text_does_not_overflow) {
    for (const std::string_view part : {"9999999999999999999W", "-9999999999999999999W"}) {
        for (const std::size_t count : {2, 15'182, 15'183, 30'000}) { // of which the third passes 2 to the 127
            for (const std::string_view sign : {"", "-"}) {
                std::string text = "\"" + std::string{sign} + "P";
                for (std::size_t i = 0; i < count; ++i) {
                    text.append(part);
                }
                text.push_back('"');
                BOOST_TEST(why<chrono::milliseconds>(text) == "a time out of range", count);
                BOOST_TEST(why<chrono::duration<double>>(text) == "a time out of range", count);
            }
        }
    }
    BOOST_TEST((from_json<chrono::seconds>("\"P9999999999999W-9999999999999W1D\"") == 24h));
}

BOOST_AUTO_TEST_CASE(a_floating_point_duration_out_of_range_is_an_error) {
    BOOST_TEST(why<chrono::duration<float>>("1e39") == "a time out of range");
    BOOST_TEST(why<chrono::duration<float>>("\"PT" + std::string(40, '9') + "S\"") == "a time out of range");
    BOOST_TEST((why<chrono::duration<double, std::nano>>("1e300") == "a time out of range"));
    BOOST_TEST(conversion_error([] { to_json(chrono::duration<double, std::exa>{1e300}); }) == "a time out of range");
    const auto most = std::numeric_limits<float>::max();
    BOOST_TEST(round_trip(chrono::duration<float>{most}).count() == most);
    BOOST_TEST((from_json<chrono::duration<float, std::milli>>("1.5").count() == 1500.0F));
}

BOOST_AUTO_TEST_CASE(a_duration_may_count_characters) {
    BOOST_TEST((round_trip(chrono::duration<char>{100}) == chrono::duration<char>{100}));
    BOOST_TEST((why<chrono::duration<char>>("300") == "a time out of range"));
}

BOOST_AUTO_TEST_CASE(durations_survive_a_round_trip) {
    for (const auto count :
         {std::int64_t{0}, std::int64_t{1}, std::int64_t{-1}, std::int64_t{999'999'999}, std::int64_t{-1'000'000'001},
          std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
        BOOST_TEST((round_trip(chrono::nanoseconds{count}) == chrono::nanoseconds{count}), count);
        BOOST_TEST((round_trip(chrono::microseconds{count}) == chrono::microseconds{count}), count);
        BOOST_TEST((round_trip(chrono::seconds{count}) == chrono::seconds{count}), count);
    }
    for (const auto seconds : {1e-300, 1.0 / 3, 1e15, 5e-324, 1.7976931348623157e308}) {
        BOOST_TEST((round_trip(chrono::duration<double>{seconds}).count() == seconds));
    }
}

BOOST_AUTO_TEST_CASE(times_are_written_in_utc) {
    const auto day = chrono::sys_days{chrono::year{2026} / 11 / 23};
    BOOST_TEST(to_json(day) == "\"2026-11-23T00:00:00Z\"");
    BOOST_TEST(to_json(day + 7h + 43min + 14s + 250ms) == "\"2026-11-23T07:43:14.25Z\"");
    BOOST_TEST(to_json(chrono::sys_time<chrono::nanoseconds>{-1ns}) == "\"1969-12-31T23:59:59.999999999Z\"");
    BOOST_TEST(to_json(chrono::sys_days{chrono::year{0} / 1 / 1}) == "\"0000-01-01T00:00:00Z\"");
    BOOST_TEST(conversion_error([] { to_json(chrono::sys_days{chrono::year{10000} / 1 / 1}); }) ==
               "a time out of range");
    const auto now = chrono::system_clock::now();
    BOOST_TEST((round_trip(now) == now));
}

BOOST_AUTO_TEST_CASE(times_are_read_in_any_zone_and_from_seconds_since_1970) {
    using time = chrono::sys_time<chrono::milliseconds>;
    const time expected = chrono::sys_days{chrono::year{2026} / 11 / 23} + 7h + 43min + 14s + 250ms;
    for (const std::string_view text :
         {"\"2026-11-23T07:43:14.25Z\"", "\"2026-11-23t07:43:14.250z\"", "\"2026-11-23 07:43:14,25Z\"",
          "\"2026-11-23T08:43:14.25+01:00\"", "\"2026-11-23T08:43:14.25+0100\"", "\"2026-11-23T05:43:14.25-02\"",
          "\"2026-11-22T23:13:14.2509-08:30\"", "1795419794.25"}) {
        BOOST_TEST((from_json<time>(text) == expected), text);
    }
    BOOST_TEST((from_json<chrono::sys_seconds>("\"2016-12-31T23:59:60Z\"") ==
                chrono::sys_days{chrono::year{2017} / 1 / 1})); // a leap second is the next one
    BOOST_TEST((from_json<chrono::sys_seconds>("-1") == chrono::sys_seconds{-1s}));
}

BOOST_AUTO_TEST_CASE(an_invalid_time_is_an_error) {
    using time = chrono::system_clock::time_point;
    const std::string expected = "expected a time as \"2026-11-23T07:43:14Z\" or a number of seconds since 1970";
    for (const std::string_view text :
         {"\"\"", "\"2026-11-23\"", "\"2026-02-30T00:00:00Z\"", "\"2026-13-01T00:00:00Z\"", "\"2026-11-23T24:00:00Z\"",
          "\"2026-11-23T07:43Z\"", "\"26-11-23T07:43:14Z\"", "\"2026-11-23T07:43:14ZZ\"", "null", "[]"}) {
        BOOST_TEST(why<time>(text) == expected, text);
    }
    BOOST_TEST(why<time>("\"2026-11-23T07:43:14\"") == "expected a time zone after the time, Z or such as +01:00");
    BOOST_TEST(why<time>("\"9999-11-23T07:43:14Z\"") == "a time out of range"); // in nanoseconds
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(sums_and_products)

BOOST_AUTO_TEST_CASE(tuples_and_pairs_are_arrays_of_their_length) {
    using triple = std::tuple<int, std::string, std::vector<double>>;
    BOOST_TEST(to_json(triple{1, "a", {2.5}}) == "[1,\"a\",[2.5]]");
    BOOST_TEST((from_json<triple>("[1, \"a\", [2.5]]") == triple{1, "a", {2.5}}));
    BOOST_TEST(to_json(std::tuple<>{}) == "[]");
    BOOST_TEST((from_json<std::tuple<>>("[]") == std::tuple<>{}));
    BOOST_TEST((round_trip(std::pair{true, std::string{"b"}}) == std::pair{true, std::string{"b"}}));
    BOOST_TEST(why<triple>("[1,\"a\"]") == "fewer than 3 elements");
    BOOST_TEST(why<triple>("[1,\"a\",[],4]") == "more than 3 elements");
    BOOST_TEST(why<triple>("[1,2,[]]") == "[1]: expected a string, got a number");
    BOOST_TEST(why<triple>("{}") == "expected an array, got an object");
    BOOST_TEST(why<std::tuple<>>("[1]") == "more than 0 elements");
}

BOOST_AUTO_TEST_CASE(an_unordered_map_is_an_object) {
    using map = std::unordered_map<std::string, std::array<int, 2>>;
    const map value{{"a", {1, 2}}, {"b\"", {3, 4}}};
    BOOST_TEST((round_trip(value) == value));
    BOOST_TEST((to_json(map{{"a", {1, 2}}}) == "{\"a\":[1,2]}"));
    BOOST_TEST((why<map>("{\"a\":[1,true]}") == "a[1]: expected a number, got true or false" ||
                why<map>("{\"a\":[1,true]}").starts_with("a[1]: expected a number")));
}

BOOST_AUTO_TEST_CASE(a_variant_is_the_value_that_it_holds) {
    using either = std::variant<std::monostate, double, std::string, pose, std::vector<int>>;
    BOOST_TEST(to_json(either{}) == "null");
    BOOST_TEST(to_json(either{2.5}) == "2.5");
    BOOST_TEST(to_json(either{std::string{"a"}}) == "\"a\"");
    BOOST_TEST(to_json(either{pose{1, 2}}) == "{\"x\":1,\"y\":2}");
    BOOST_TEST(from_json<either>("null").index() == 0U);
    BOOST_TEST(std::get<double>(from_json<either>(" 2.5 ")) == 2.5);
    BOOST_TEST(std::get<std::string>(from_json<either>("\"a\"")) == "a");
    BOOST_TEST(std::get<pose>(from_json<either>("{\"x\":1,\"y\":2}")).y == 2.0);
    BOOST_TEST(std::get<std::vector<int>>(from_json<either>("[1,2]")).size() == 2U);
    BOOST_TEST((why<std::variant<double, pose>>("{\"x\":1}") ==
                "matches no alternative: expected a number, got an object; y: is missing"));
    BOOST_TEST((why<std::map<std::string, std::variant<bool>>>("{\"a\":1}") ==
                "a: matches no alternative: expected true or false, got a number"));
    // The first alternative that fits.
    BOOST_TEST((from_json<std::variant<int, double>>("2").index() == 0U));
    BOOST_TEST((from_json<std::variant<int, double>>("2.5").index() == 1U));
}

// A scalar is sent as {"value":x}, which may also be an object of the type.
BOOST_AUTO_TEST_CASE(an_object_that_looks_like_a_wrapped_scalar_survives_a_round_trip_as_body) {
    using cles::detail::to_body;
    using either = std::variant<reading, double>;
    BOOST_TEST(to_body(either{5.0}) == R"({"value":5})");
    BOOST_TEST(to_body(either{reading{5}}) == R"({"value":{"value":5}})");
    BOOST_TEST(round_trip_as_body(either{reading{5}}).index() == 0U);
    BOOST_TEST(round_trip_as_body(either{5.0}).index() == 1U);
    BOOST_TEST(round_trip_as_body(std::variant<double, reading>{reading{5}}).index() == 1U);
    BOOST_TEST(round_trip_as_body(std::optional<either>{reading{5}})->index() == 0U);
    // Where nothing else is read from the scalar, the object stays as it is.
    BOOST_TEST(to_body(std::optional<reading>{reading{5}}) == R"({"value":5})");
    BOOST_TEST(round_trip_as_body(std::optional<reading>{reading{5}})->value == 5.0);
    BOOST_TEST(to_body(std::variant<reading, std::string>{reading{5}}) == R"({"value":5})");
    BOOST_TEST(to_body(std::vector<either>{reading{5}, 5.0}) == R"([{"value":5},5])");

    using by_name = std::map<std::string, double>;
    using named = std::variant<by_name, double>;
    BOOST_TEST(round_trip_as_body(named{by_name{{"value", 3}}}).index() == 0U);
    BOOST_TEST(to_body(named{by_name{{"value", 3}, {"x", 1}}}) == R"({"value":3,"x":1})");
    using holes = std::map<std::string, std::optional<double>>;
    BOOST_TEST(round_trip_as_body(std::optional<holes>{holes{{"value", std::nullopt}}}).has_value());
    BOOST_TEST(!round_trip_as_body(std::optional<holes>{}).has_value());

    // What is wrapped looks like an object that a type may hold, too.
    using deep = std::variant<outer, reading, double>;
    BOOST_TEST(round_trip_as_body(deep{outer{reading{5}}}).index() == 0U);
    BOOST_TEST(round_trip_as_body(deep{reading{5}}).index() == 1U);
    BOOST_TEST(round_trip_as_body(deep{5.0}).index() == 2U);
    // As a program without the type may send it.
    BOOST_TEST(from_json<cles::detail::wrapped<std::optional<outer>>>(R"({"value":{"value":5}})").value->value.value ==
               5.0);
}

BOOST_AUTO_TEST_CASE(types_that_may_be_scalars_survive_a_round_trip_as_body) {
    using cles::detail::to_body;
    BOOST_TEST(to_body(1500ms) == "{\"value\":\"PT1.5S\"}");
    BOOST_TEST(to_body(std::optional<int>{}) == "{\"value\":null}");
    BOOST_TEST(to_body(std::optional<pose>{pose{1, 2}}) == "{\"x\":1,\"y\":2}");
    BOOST_TEST(to_body(std::variant<double, pose>{2.5}) == "{\"value\":2.5}");
    BOOST_TEST(to_body(std::variant<double, pose>{pose{1, 2}}) == "{\"x\":1,\"y\":2}");
    BOOST_TEST(to_body(std::vector<int>{1}) == "[1]");
    BOOST_TEST(to_body("text") == "{\"value\":\"text\"}");
    BOOST_TEST(to_body(cles::json_text{" 5"}) == "{\"value\":5}");
    BOOST_TEST(to_body(cles::json_text{"[5]"}) == "[5]");
    BOOST_TEST((round_trip_as_body(1500ms) == 1500ms));
    BOOST_TEST((round_trip_as_body(std::optional<int>{5}) == 5));
    BOOST_TEST((!round_trip_as_body(std::optional<int>{}).has_value()));
    BOOST_TEST((round_trip_as_body(std::optional<pose>{pose{1, 2}})->y == 2.0));
    BOOST_TEST((!round_trip_as_body(std::optional<pose>{}).has_value()));
    using either = std::variant<double, pose, std::vector<int>>;
    BOOST_TEST((std::get<double>(round_trip_as_body(either{2.5})) == 2.5));
    BOOST_TEST((std::get<pose>(round_trip_as_body(either{pose{1, 2}})).x == 1.0));
    BOOST_TEST((std::get<2>(round_trip_as_body(either{std::vector<int>{1, 2}})).size() == 2U));
    BOOST_TEST(round_trip_as_body(celsius{21.5}).degrees == 21.5);
    // An empty object holds no value.
    BOOST_TEST(!from_json<cles::detail::wrapped<std::optional<int>>>("{}").value.has_value());
    // An object that is not a wrapper.
    using maybe = cles::detail::wrapped<std::optional<std::map<std::string, std::vector<int>>>>;
    BOOST_TEST(from_json<maybe>("{\"value\":[1]}").value->at("value").size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(defaults)

BOOST_AUTO_TEST_CASE(a_member_with_a_default_may_be_missing_and_keeps_its_initialiser) {
    const auto old = from_json<position>("{\"utc\":1,\"quality\":2,\"lat\":3}");
    BOOST_TEST(old.heading == 90.0);
    BOOST_TEST(old.lanes.size() == 1U);
    const auto whole = from_json<position>("{\"utc\":1,\"quality\":2,\"lat\":3,\"heading\":4,\"lanes\":[]}");
    BOOST_TEST(whole.heading == 4.0);
    BOOST_TEST(whole.lanes.empty());
}

BOOST_AUTO_TEST_CASE(other_missing_members_are_still_errors) {
    BOOST_TEST(why<position>("{\"utc\":1,\"quality\":2,\"heading\":4}") == "lat: is missing");
    BOOST_TEST(why<stamped>("{}") == "utc: is missing");
}

BOOST_AUTO_TEST_CASE(defaults_of_a_base_class_are_inherited) {
    BOOST_TEST(from_json<position>("{\"utc\":1,\"lat\":3}").quality == 0.5);
    BOOST_TEST(from_json<stamped>("{\"utc\":1}").quality == 0.5);
}

BOOST_AUTO_TEST_CASE(a_class_may_declare_its_own_defaults) {
    BOOST_TEST(from_json<inside>("{\"old\":5}").added == 2);
    BOOST_TEST(why<inside>("{\"added\":5}") == "old: is missing");
}

BOOST_AUTO_TEST_CASE(a_default_does_not_allow_another_kind_of_value) {
    BOOST_TEST(why<position>("{\"utc\":1,\"lat\":3,\"heading\":\"north\"}") ==
               "heading: expected a number, got a string");
    BOOST_TEST(why<position>("{\"utc\":1,\"lat\":3,\"lanes\":null}") == "lanes: expected an array, got null");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(text)

BOOST_AUTO_TEST_CASE(text_that_is_not_utf8_is_not_written_and_the_error_names_it) {
    const std::string bad = "a\xFFz";
    BOOST_TEST(conversion_error([&] { to_json(bad); }) == "text that is not UTF-8");
    BOOST_TEST(conversion_error([&] { cles::detail::to_body(bad); }) == "text that is not UTF-8");
    BOOST_TEST(conversion_error([&] { to_json(note{.text = bad, .more = {}}); }) == "text: text that is not UTF-8");
    BOOST_TEST(conversion_error([&] {
                   to_json(note{.text = "\"],{", .more = {{{"a", "b"}}, {{"c", "d"}, {"e\"", bad}}}});
               }) == "more[1].e\\\": text that is not UTF-8");
    BOOST_TEST(conversion_error([&] {
                   to_json(std::map<std::string, int>{{"a", 1}, {bad, 2}});
               }) == "a: text that is not UTF-8"); // the error names the member before it
    BOOST_TEST(conversion_error([&] {
                   to_json(std::vector<std::string>{"a", "b", "\xC3"});
               }) == "[2]: text that is not UTF-8");
    BOOST_TEST(to_json(std::string{"\xC3\xA4"}) == "\"\xC3\xA4\"");
}

BOOST_AUTO_TEST_CASE(a_writer_reports_where_it_first_repaired_text) {
    std::string out = "before";
    cles::json_writer w{out};
    w.begin_array();
    w.value(std::string_view{"fine"});
    BOOST_TEST(w.broken_text() == cles::json_writer::npos);
    w.value(std::string_view{"\xFF"});
    w.value(std::string_view{"\xFE"});
    w.end_array();
    BOOST_TEST(w.broken_text() == std::string_view{"[\"fine\",\""}.size());
}

BOOST_AUTO_TEST_CASE(json_text_that_is_not_json_is_a_failed_conversion) {
    BOOST_TEST(
        conversion_error([] { to_json(cles::json_text{"{\"a\":"}); }).starts_with("the text to send is not JSON"));
    BOOST_TEST(conversion_error([] { to_json(cles::json_text{"[\"\xFF\"]"}); }).starts_with("the text to send is not"));
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
