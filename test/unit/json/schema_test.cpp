// SPDX-License-Identifier: BSL-1.0
#include <cles/schema.hpp>
#include <cles/types.hpp>

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace schema_types {

enum class gear { park, drive };
BOOST_DESCRIBE_ENUM(gear, park, drive)

struct position {
    double lat = 0;
    double lon = 0;
    float speed = 0;
};
BOOST_DESCRIBE_STRUCT(position, (), (lat, lon, speed))
CLES_DEFAULTS(position, (speed))
CLES_FIELD(position, lat, "deg", "latitude, WGS 84", -90, 90)
CLES_FIELD(position, lon, "deg")
CLES_FIELD(position, speed, "m/s", "over ground")

struct route {
    std::vector<position> points;
    std::optional<std::uint8_t> lanes;
    gear first = gear::park;
    std::chrono::milliseconds hold{};
};
BOOST_DESCRIBE_STRUCT(route, (), (points, lanes, first, hold))

struct branch {
    std::vector<branch> below;
};
BOOST_DESCRIBE_STRUCT(branch, (), (below))

struct alone {
    double value = 0;
};
BOOST_DESCRIBE_STRUCT(alone, (), (value))

struct limited {
    std::int32_t level = 0;
    std::optional<double> share;
};
BOOST_DESCRIBE_STRUCT(limited, (), (level, share))
CLES_FIELD(limited, level, "", "", 1, 5)
CLES_FIELD(limited, share, "", "", 0, 1)

} // namespace schema_types

BOOST_AUTO_TEST_SUITE(schema)

BOOST_AUTO_TEST_CASE(a_described_struct_is_told) {
    BOOST_TEST(cles::schema_of<schema_types::branch>() ==
               R"({"$ref":"#/$defs/branch","$defs":{"branch":{"type":"object","properties":{"below":)"
               R"({"type":"array","items":{"$ref":"#/$defs/branch"}}},"required":["below"]}}})");
    BOOST_TEST(cles::schema_of<std::uint8_t>() ==
               R"({"type":"object","properties":{"value":{"type":"integer","minimum":0,"maximum":255}},)"
               R"("required":["value"]})");
    BOOST_TEST(cles::schema_of<void>() == R"({"type":"object","maxProperties":0})");
    BOOST_TEST(cles::schema_of<cles::json_text>() == "{}");
}

BOOST_AUTO_TEST_CASE(a_mismatch_names_the_member) {
    const cles::schema known{cles::schema_of<schema_types::route>()};
    const std::string good = R"({"points":[{"lat":1,"lon":2}],"first":"drive","hold":"PT2S"})";
    BOOST_TEST(known.mismatch(good).empty());
    BOOST_TEST(known.mismatch(R"({"points":[{"lat":1,"lon":2},{"lat":"x","lon":2}],"first":"drive","hold":1})") ==
               "points[1].lat: expected a number or null, got a string");
    BOOST_TEST(known.mismatch(R"({"points":[{"lat":91,"lon":2}],"first":"drive","hold":1})")
                   .starts_with("points[0].lat: outside of its range"));
    BOOST_TEST(known.mismatch(R"({"points":[{"lat":1}],"first":"drive","hold":1})") == "points[0].lon: is missing");
    BOOST_TEST(known.mismatch(R"({"points":[],"first":"fly","hold":1})") == "first: expected one of park, drive");
    BOOST_TEST(known.mismatch(R"({"points":[],"first":"park","hold":1,"lanes":256})")
                   .starts_with("lanes: outside of its range"));
    BOOST_TEST(known.mismatch(R"({"points":[],"first":"park","hold":1,"lanes":null,"other":[]})").empty());
    BOOST_TEST(!known.mismatch("{").empty());
}

BOOST_AUTO_TEST_CASE(a_range_is_checked_when_it_is_read_and_written) {
    schema_types::limited read;
    std::string why;
    BOOST_TEST(cles::from_json(R"({"level":5,"share":null})", read));
    BOOST_TEST(!cles::from_json(R"({"level":6})", read, &why));
    BOOST_TEST(why.starts_with("level: a number outside of its range, 1 to 5"));
    BOOST_TEST(!cles::from_json(R"({"level":1,"share":1.5})", read));
    read.level = 0;
    BOOST_CHECK_THROW(static_cast<void>(cles::to_json(read)), cles::error);
}

BOOST_AUTO_TEST_CASE(what_encloses_a_scalar_fits_as_often_as_it_is_read) {
    using either = std::variant<std::map<std::string, schema_types::alone>, schema_types::alone, double>;
    const cles::schema told{cles::schema_of<either>()};
    std::string text = "1";
    for (int levels = 0; levels < 6; ++levels) {
        cles::detail::wrapped<either> read;
        BOOST_TEST(told.mismatch(text).empty() == cles::from_json(text, read), text);
        text = R"({"value":)" + text + "}";
    }
}

BOOST_AUTO_TEST_CASE(an_example_fits) {
    const cles::schema known{cles::schema_of<schema_types::route>()};
    const auto example = known.example();
    BOOST_TEST(example == R"({"points":[{"lat":0,"lon":0,"speed":0}],"first":"park","hold":"PT1S"})");
    schema_types::route read;
    BOOST_TEST(cles::from_json(example, read));
    BOOST_TEST(cles::schema{cles::schema_of<schema_types::limited>()}.example() == R"({"level":1})");
    BOOST_TEST(!cles::schema{cles::schema_of<schema_types::branch>()}.example().empty());
}

BOOST_AUTO_TEST_CASE(members_are_listed_with_their_units) {
    const auto members = cles::schema{cles::schema_of<std::vector<schema_types::position>>()}.members();
    BOOST_TEST(members.empty()); // an array has none
    const auto of = cles::schema{cles::schema_of<schema_types::position>()}.members();
    BOOST_REQUIRE(of.size() == 3U);
    BOOST_TEST(of[0].path == "lat");
    BOOST_TEST(of[0].type == "number");
    BOOST_TEST(of[0].unit == "deg");
    BOOST_TEST(of[0].meaning == "latitude, WGS 84");
    BOOST_TEST(of[0].range == "-90 to 90");
    BOOST_TEST(of[0].required);
    BOOST_TEST(of[2].standard == "0");
    BOOST_TEST(!of[2].required);
    const auto inner = cles::schema{cles::schema_of<schema_types::route>()}.members();
    BOOST_REQUIRE(inner.size() == 7U);
    BOOST_TEST(inner[0].type == "array of position");
    BOOST_TEST(inner[1].path == "points[].lat");
    BOOST_TEST(inner[5].type == "one of park, drive");
    BOOST_TEST(inner[6].type == "duration");
}

BOOST_AUTO_TEST_CASE(what_is_not_in_the_subset_is_refused) {
    for (const std::string text :
         {"[]", "1", R"({"pattern":"a"})", R"({"type":"real"})", R"({"type":[]})", R"({"anyOf":[]})",
          R"({"$ref":"other.json"})", R"({"$ref":"#/$defs/none"})", R"({"properties":{"a":1}})", R"({"minItems":-1})",
          R"({"items":{"$defs":{}}})", R"({"ticks":{"num":0,"den":1}})", "{"}) {
        BOOST_CHECK_THROW(cles::schema{text}, cles::error);
    }
    const cles::schema circle{R"({"$ref":"#"})"};
    BOOST_TEST(circle.mismatch("1") == "the schema refers to itself");
    const cles::schema wide{R"({"anyOf":[{"$ref":"#"},{"$ref":"#"}]})"};
    BOOST_TEST(!wide.mismatch("1").empty());
    BOOST_TEST(cles::schema{R"({"x-note":1,"title":"any"})"}.mismatch("[1]").empty());
    BOOST_TEST(cles::schema{"false"}.mismatch("1") == "is not allowed");
}

BOOST_AUTO_TEST_CASE(the_types_of_a_task_are_read_back) {
    const auto text =
        cles::task_types({.body = cles::schema_of<schema_types::position>(), .result = R"({ "type" : "object" })"});
    const auto read = cles::read_task_types(text);
    BOOST_TEST(read.body == cles::schema_of<schema_types::position>());
    BOOST_TEST(read.result == R"({"type":"object"})");
    BOOST_TEST(read.updates.empty());
    BOOST_TEST(cles::task_types({}).empty());
    BOOST_CHECK_THROW(static_cast<void>(cles::task_types({.body = R"({"oneOf":[]})"})), cles::error);
    BOOST_CHECK_THROW(static_cast<void>(cles::read_task_types("[]")), cles::error);
}

BOOST_AUTO_TEST_SUITE_END()
