// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/convert_wrapped.hpp>

#include "support/converted.hpp"

#include <boost/describe.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace convert_types {

enum class gear { park, drive, reverse };
BOOST_DESCRIBE_ENUM(gear, park, drive, reverse)

struct point {
    double lat = 0;
    double lon = 0;
};
BOOST_DESCRIBE_STRUCT(point, (), (lat, lon))

struct plan {
    std::string name;
    std::vector<point> route;
    std::optional<std::uint8_t> lanes;
    gear first = gear::park;
    std::map<std::string, std::int32_t> limits;
};
BOOST_DESCRIBE_STRUCT(plan, (), (name, route, lanes, first, limits))

struct stamped {
    std::int64_t utc = 0;
};
BOOST_DESCRIBE_STRUCT(stamped, (), (utc))

struct stamped_point : stamped, point {
    bool good = false;
};
BOOST_DESCRIBE_STRUCT(stamped_point, (stamped, point), (good))

struct nothing {};
BOOST_DESCRIBE_STRUCT(nothing, (), ())

struct celsius {
    double degrees = 0;
};

enum class sensors : unsigned { none = 0, gps = 1, imu = 2, lidar = 4 };
BOOST_DESCRIBE_ENUM(sensors, none, gps, imu, lidar)
constexpr sensors operator|(sensors a, sensors b) {
    return static_cast<sensors>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}

enum class level { low = 1, medium = 2, high = 4 };
BOOST_DESCRIBE_ENUM(level, low, medium, high)

enum class rights : std::uint8_t { read = 1, write = 2 };
BOOST_DESCRIBE_ENUM(rights, read, write)
constexpr rights operator|(rights a, rights b) {
    return static_cast<rights>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}

enum class offset : std::int8_t { back = -1, none = 0, ahead = 1 };
BOOST_DESCRIBE_ENUM(offset, back, none, ahead)

enum class mode { off, auto_ };
BOOST_DESCRIBE_ENUM(mode, off, auto_)
CLES_NAMES(mode, (auto_, "auto"))

struct command {
    char axis = 'x';
    int steps = 0;
};
BOOST_DESCRIBE_STRUCT(command, (), (axis, steps))

struct state {
    gear selected = gear::park;
};
BOOST_DESCRIBE_STRUCT(state, (), (selected))

class account {
  public:
    account() = default;
    account(int id, std::string owner, double balance) : id_(id), owner_(std::move(owner)), balance_(balance) {}
    [[nodiscard]] bool operator==(const account&) const = default;

    int id_ = 0;

  protected:
    std::string owner_;

  private:
    double balance_ = 0;
    int secret_ = 7; // not described

    BOOST_DESCRIBE_CLASS(account, (), (id_), (owner_), (balance_))
};

class savings : public account {
  public:
    using account::account;

  private:
    double rate_ = 0.5;

    BOOST_DESCRIBE_CLASS(savings, (account), (), (), (rate_))
};

struct pose {
    std::string klass;
    double yaw_rate = 0.5;
    int plain = 0;
};
BOOST_DESCRIBE_STRUCT(pose, (), (klass, yaw_rate, plain))
CLES_NAMES(pose, (klass, "class"), (yaw_rate, "yaw rate, in °/s"))
CLES_DEFAULTS(pose, (yaw_rate))

struct stamped_pose : pose {
    std::int64_t utc = 0;
};
BOOST_DESCRIBE_STRUCT(stamped_pose, (pose), (utc))
CLES_NAMES(stamped_pose, (utc, "time"))

struct tree {
    std::vector<tree> below;
};
BOOST_DESCRIBE_STRUCT(tree, (), (below))

// As structs of C have it.
struct interface {
    char name[8]; // NOLINT(modernize-avoid-c-arrays)
    char key[16]; // NOLINT(modernize-avoid-c-arrays): not described, and not to be sent
    int index = 1;
};
BOOST_DESCRIBE_STRUCT(interface, (), (name, index))

struct place {
    const char* name = nullptr;
};
BOOST_DESCRIBE_STRUCT(place, (), (name))

struct passed_on {
    std::string text;
};

} // namespace convert_types

template <>
struct cles::converter<convert_types::passed_on> {
    static void write(json_writer& w, const convert_types::passed_on& value) { w.raw(value.text); }
};

template <>
struct cles::converter<convert_types::celsius> {
    static void write(json_writer& w, const convert_types::celsius& value) { w.value(value.degrees); }
    static bool read(json_reader& r, convert_types::celsius& value) { return r.read(value.degrees); }
};

namespace convert {
namespace {

using namespace convert_types;
using cles::from_json;
using cles::to_json;
using cles::test::round_trip;
using cles::test::why;

} // namespace
} // namespace convert

BOOST_AUTO_TEST_SUITE(convert)

BOOST_AUTO_TEST_SUITE(scalars)

BOOST_AUTO_TEST_CASE(scalars_are_written_and_read) {
    BOOST_TEST(to_json(true) == "true");
    BOOST_TEST(to_json(-5) == "-5");
    BOOST_TEST(to_json(45.1) == "45.1");
    BOOST_TEST(to_json(std::string{"a\"b"}) == "\"a\\\"b\"");
    BOOST_TEST(to_json("literal") == "\"literal\"");
    BOOST_TEST(to_json(std::string_view{"view"}) == "\"view\"");
    BOOST_TEST(from_json<bool>(" true ") == true);
    BOOST_TEST(from_json<int>("-5") == -5);
    BOOST_TEST(from_json<double>("45.1") == 45.1);
    BOOST_TEST(from_json<std::string>("\"a\\\"b\"") == "a\"b");
}

BOOST_AUTO_TEST_CASE(an_integer_that_does_not_fit_its_type_is_an_error) {
    BOOST_TEST(from_json<std::uint8_t>("255") == 255);
    BOOST_TEST(why<std::uint8_t>("256") == "an integer out of range");
    BOOST_TEST(why<std::uint8_t>("-1").starts_with("an integer out of range"));
    BOOST_TEST(from_json<std::int8_t>("-128") == -128);
    BOOST_TEST(why<std::int8_t>("-129") == "an integer out of range");
    BOOST_TEST(why<std::int32_t>("2147483648") == "an integer out of range");
    BOOST_TEST(why<int>("1.0") == "expected an integer");
    BOOST_TEST(why<int>("1e2") == "expected an integer");
}

BOOST_AUTO_TEST_CASE(a_double_reads_any_number_and_round_trips_exactly) {
    BOOST_TEST(from_json<double>("7") == 7.0);
    std::mt19937_64 random{61};
    for (int i = 0; i < 100'000; ++i) {
        const auto d = std::bit_cast<double>(random());
        if (std::isfinite(d)) {
            BOOST_REQUIRE(std::bit_cast<std::uint64_t>(round_trip(d)) == std::bit_cast<std::uint64_t>(d));
        }
        const auto f = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
        if (std::isfinite(f)) {
            BOOST_REQUIRE(std::bit_cast<std::uint32_t>(round_trip(f)) == std::bit_cast<std::uint32_t>(f));
        }
    }
}

BOOST_AUTO_TEST_CASE(a_float_out_of_range_is_an_error) {
    for (const std::string_view text : {"1e39", "-1e39", "3.5e38", "1e300", "1e400"}) {
        BOOST_TEST(why<float>(text) == "a number out of the range of a float", text);
    }
    for (const std::string_view text :
         {"3.4028235e38", "-3.4028235e38", "3.40282346638528859811704183484516925440e38"}) {
        BOOST_TEST(std::fabs(from_json<float>(text)) == std::numeric_limits<float>::max(), text);
    }
    BOOST_TEST(from_json<float>("1e-50") == 0.0F);
    BOOST_TEST(from_json<float>("1.4e-45") == std::numeric_limits<float>::denorm_min());
    BOOST_TEST(why<std::vector<float>>("[1,1e39]") == "[1]: a number out of the range of a float");
    BOOST_TEST(why<float>("\"1\"") == "expected a number, got a string");
}

BOOST_AUTO_TEST_CASE(a_float_is_written_with_the_fewest_digits) {
    BOOST_TEST(to_json(0.1F) == "0.1");
    BOOST_TEST(to_json(-16777216.0F) == "-16777216");
    BOOST_TEST(to_json(std::vector<float>{3.3F, 1.5F}) == "[3.3,1.5]");
    BOOST_TEST(from_json<float>(to_json(std::numeric_limits<float>::max())) == std::numeric_limits<float>::max());
    BOOST_TEST(from_json<float>(to_json(std::numeric_limits<float>::denorm_min())) ==
               std::numeric_limits<float>::denorm_min());
    BOOST_TEST(to_json(std::numeric_limits<float>::infinity()) == "null");
}

BOOST_AUTO_TEST_CASE(a_character_is_a_number) {
    BOOST_TEST(to_json(command{'y', 3}) == R"({"axis":121,"steps":3})");
    BOOST_TEST(from_json<command>(R"({"axis":121,"steps":3})").axis == 'y');
    BOOST_TEST(why<command>(R"({"axis":256,"steps":3})") == "axis: an integer out of range");
    BOOST_TEST(why<command>(R"({"axis":"x","steps":3})") == "axis: expected a number, got a string");
    BOOST_TEST((round_trip(char8_t{200}) == char8_t{200}));
    BOOST_TEST((round_trip(char16_t{65'535}) == char16_t{65'535}));
    BOOST_TEST((round_trip(char32_t{0x10FFFF}) == char32_t{0x10FFFF}));
    BOOST_TEST((round_trip(L'\xE9') == L'\xE9'));
    BOOST_TEST(why<char16_t>("65536") == "an integer out of range");
    BOOST_TEST(why<char32_t>("-1").starts_with("an integer out of range"));
    BOOST_TEST(from_json<cles::detail::wrapped<char>>(cles::detail::to_body('a')).value == 'a');
}

BOOST_AUTO_TEST_CASE(a_long_double_that_no_double_holds_is_not_written) {
    if constexpr (std::numeric_limits<long double>::max() > std::numeric_limits<double>::max()) {
        BOOST_CHECK_EXCEPTION(to_json(std::numeric_limits<long double>::max()), cles::error, [](const cles::error& e) {
            return e.code() == cles::errc::conversion && e.message() == "a number out of the range of a double";
        });
    }
    BOOST_TEST(to_json(0.5L) == "0.5");
    BOOST_TEST(to_json(std::numeric_limits<long double>::infinity()) == "null");
}

BOOST_AUTO_TEST_CASE(an_array_of_char_ends_with_the_array) {
    interface can {};
    std::memcpy(can.name, "vcan0-in", sizeof can.name);
    std::memcpy(can.key, "SECRET-KEY-0123", sizeof can.key);
    BOOST_TEST(to_json(can) == R"({"name":"vcan0-in","index":1})");
    std::memcpy(can.name, "lo", 3);
    BOOST_TEST(to_json(can) == R"({"name":"lo","index":1})");
    BOOST_TEST(cles::detail::to_body(can.name) == R"({"value":"lo"})");
}

BOOST_AUTO_TEST_CASE(a_null_pointer_to_text_is_null) {
    BOOST_TEST(to_json(static_cast<const char*>(nullptr)) == "null");
    BOOST_TEST(to_json(place{}) == R"({"name":null})");
    BOOST_TEST(cles::detail::to_body(static_cast<const char*>(nullptr)) == R"({"value":null})");
}

BOOST_AUTO_TEST_CASE(an_integer_of_more_than_64_bits_does_not_convert) {
#if defined(__SIZEOF_INT128__)
    __extension__ using wide = __int128;
    __extension__ using unsigned_wide = unsigned __int128;
    static_assert(!cles::detail::writable<wide> && !cles::detail::readable<wide>);
    static_assert(!cles::detail::writable<unsigned_wide> && !cles::detail::readable<unsigned_wide>);
#endif
}

BOOST_AUTO_TEST_CASE(a_number_that_is_not_finite_becomes_null_and_reads_as_nan) {
    BOOST_TEST(to_json(std::numeric_limits<double>::infinity()) == "null");
    BOOST_TEST(std::isnan(from_json<double>("null")));
}

BOOST_AUTO_TEST_CASE(a_value_of_another_kind_is_an_error) {
    BOOST_TEST(why<bool>("1") == "expected true or false, got a number");
    BOOST_TEST(why<int>("\"5\"") == "expected a number, got a string");
    BOOST_TEST(why<double>("[]") == "expected a number, got an array");
    BOOST_TEST(why<std::string>("5") == "expected a string, got a number");
    BOOST_TEST(why<int>("null") == "expected a number, got null");
    BOOST_TEST(why<int>("5 x") == "more text after the value");
    BOOST_TEST(why<int>("") == "expected a number, but the text ends");
}

BOOST_AUTO_TEST_CASE(an_enum_is_written_as_its_names) {
    BOOST_TEST(to_json(gear::drive) == "\"drive\"");
    BOOST_CHECK(from_json<gear>("\"reverse\"") == gear::reverse);
    BOOST_TEST(why<gear>("\"fly\"") == "expected one of park, drive, reverse");
    BOOST_TEST(why<gear>("1") == "expected a string, got a number");
}

BOOST_AUTO_TEST_CASE(a_value_of_an_enum_that_no_reader_accepts_is_not_written) {
    const auto message = [](const auto& value) {
        try {
            return to_json(value);
        } catch (const cles::error& e) {
            return e.code() == cles::errc::conversion ? e.message() : std::string{e.what()};
        }
    };
    BOOST_TEST(message(static_cast<gear>(17)) == "17 is none of park, drive, reverse");
    BOOST_TEST(message(static_cast<gear>(3)) == "3 is none of park, drive, reverse");
    BOOST_TEST(message(static_cast<level>(3)) == "3 is none of low, medium, high"); // bits alone are no flags
    BOOST_TEST(why<level>("3") == "expected a string, got a number");
    BOOST_TEST(message(std::vector{state{}, state{static_cast<gear>(9)}}) ==
               "[1].selected: 9 is none of park, drive, reverse");
    BOOST_TEST(message(static_cast<offset>(-2)) == "-2 is none of back, none, ahead");
    BOOST_TEST(message(static_cast<sensors>(9)) == "9 is none of none, gps, imu, lidar");
    BOOST_TEST(why<gear>("3") == "expected a string, got a number");
}

BOOST_AUTO_TEST_CASE(combined_flags_are_numbers) {
    const auto both = sensors::gps | sensors::lidar;
    BOOST_TEST(to_json(both) == "5");
    BOOST_TEST((round_trip(both) == both));
    BOOST_TEST(to_json(sensors::imu) == "\"imu\"");
    BOOST_TEST((from_json<sensors>("2") == sensors::imu)); // as programs without the names may send it
    BOOST_TEST(why<sensors>("8") == "a number that combines no flags");
    BOOST_TEST(why<sensors>("-1").starts_with("an integer out of range"));
    BOOST_TEST(why<sensors>("1.5") == "expected an integer");
    BOOST_TEST(why<sensors>("\"radar\"") == "expected one of none, gps, imu, lidar");
    BOOST_TEST((round_trip(rights::read | rights::write) == (rights::read | rights::write)));
    BOOST_TEST((from_json<offset>("\"back\"") == offset::back));
    BOOST_TEST(why<offset>("-1") == "expected a string, got a number");
}

BOOST_AUTO_TEST_CASE(an_enumerator_may_have_another_name) {
    BOOST_TEST(to_json(mode::auto_) == "\"auto\"");
    BOOST_TEST((from_json<mode>("\"auto\"") == mode::auto_));
    BOOST_TEST(to_json(mode::off) == "\"off\"");
    BOOST_TEST(why<mode>("\"auto_\"") == "expected one of off, auto");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(containers)

BOOST_AUTO_TEST_CASE(vectors_and_arrays_are_arrays) {
    BOOST_TEST(to_json(std::vector<int>{}) == "[]");
    BOOST_TEST(to_json(std::vector<std::vector<int>>{{1, 2}, {}}) == "[[1,2],[]]");
    BOOST_TEST(to_json(std::vector<bool>{true, false}) == "[true,false]");
    BOOST_TEST(to_json(std::array<int, 3>{1, 2, 3}) == "[1,2,3]");
    BOOST_TEST(from_json<std::vector<int>>("[1, 2]") == (std::vector<int>{1, 2}), boost::test_tools::per_element());
    BOOST_TEST((from_json<std::vector<bool>>("[true,false]") == std::vector<bool>{true, false}));
    BOOST_TEST((from_json<std::array<int, 2>>("[1,2]") == std::array<int, 2>{1, 2}));
}

BOOST_AUTO_TEST_CASE(reading_a_vector_replaces_what_was_there) {
    std::vector<int> values{7, 8, 9};
    BOOST_TEST(from_json("[1]", values));
    BOOST_TEST(values == std::vector<int>{1}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_array_has_its_size) {
    BOOST_TEST((why<std::array<int, 2>>("[1]") == "fewer than 2 elements"));
    BOOST_TEST((why<std::array<int, 2>>("[1,2,3]") == "more than 2 elements"));
}

BOOST_AUTO_TEST_CASE(a_map_is_an_object) {
    using map = std::map<std::string, std::vector<int>>;
    BOOST_TEST(to_json(map{{"b", {1}}, {"a\"", {}}}) == "{\"a\\\"\":[],\"b\":[1]}");
    const map expected{{"a", {1}}, {"b", {}}};
    BOOST_TEST((from_json<map>("{\"b\":[],\"a\":[1]}") == expected));
    BOOST_TEST((why<map>("{\"a\":[1,\"x\"]}") == "a[1]: expected a number, got a string"));
    BOOST_TEST((why<map>("[]") == "expected an object, got an array"));
}

BOOST_AUTO_TEST_CASE(keys_of_maps_may_be_integers_and_enums) {
    using numbered = std::map<int, std::string>;
    BOOST_TEST(to_json(numbered{{-7, "a"}, {12, "b"}}) == R"({"-7":"a","12":"b"})");
    BOOST_TEST((round_trip(numbered{{-7, "a"}, {12, "b"}}) == numbered{{-7, "a"}, {12, "b"}}));
    BOOST_TEST((round_trip(std::map<char, bool>{{'x', true}}) == std::map<char, bool>{{'x', true}}));
    for (const std::string_view key : {"1.5", "x", "", "01", "+1", "-0", " 1", "99999999999999999999"}) {
        const auto text = "{\"" + std::string{key} + "\":\"a\"}";
        BOOST_TEST(why<numbered>(text).ends_with("the key is not an integer"), text);
    }
    BOOST_TEST(why<numbered>(R"({"2147483648":"a"})") == "2147483648: the key is out of range");
    BOOST_TEST((why<std::map<unsigned, bool>>(R"({"-1":true})") == "-1: the key is not an integer of 0 or more"));
    BOOST_TEST((why<std::map<int, int>>(R"({"3":"x"})") == "3: expected a number, got a string"));

    using by_gear = std::map<gear, std::vector<int>>;
    BOOST_TEST(to_json(by_gear{{gear::drive, {1}}, {gear::park, {}}}) == R"({"park":[],"drive":[1]})");
    BOOST_TEST((round_trip(by_gear{{gear::drive, {1}}}) == by_gear{{gear::drive, {1}}}));
    BOOST_TEST(why<by_gear>(R"({"fly":[]})") == "fly: the key is not one of park, drive, reverse");
    BOOST_TEST(why<by_gear>(R"({"drive":[true]})") == "drive[0]: expected a number, got true or false");
    using by_sensors = std::map<sensors, int>;
    BOOST_TEST(
        (round_trip(by_sensors{{sensors::gps | sensors::imu, 1}}) == by_sensors{{sensors::gps | sensors::imu, 1}}));
    BOOST_TEST(why<by_sensors>(R"({"1":1})") == "1: the key is not one of none, gps, imu, lidar");
    BOOST_CHECK_THROW(to_json(by_gear{{static_cast<gear>(17), {}}}), cles::error);
}

BOOST_AUTO_TEST_CASE(an_optional_is_its_value_or_null) {
    BOOST_TEST(to_json(std::optional<int>{5}) == "5");
    BOOST_TEST(to_json(std::optional<int>{}) == "null");
    BOOST_TEST(from_json<std::optional<int>>("5").value() == 5);
    BOOST_TEST(!from_json<std::optional<int>>("null").has_value());
    std::optional<int> full{7};
    BOOST_TEST(from_json("null", full));
    BOOST_TEST(!full.has_value());
    BOOST_TEST(why<std::optional<int>>("\"x\"") == "expected a number, got a string");
}

BOOST_AUTO_TEST_CASE(json_text_is_copied_without_white_space) {
    BOOST_TEST(to_json(cles::json_text{}) == "{}");
    BOOST_TEST(to_json(cles::json_text{" { \"a b\" : 1 } "}) == "{\"a b\":1}");
    BOOST_TEST(from_json<cles::json_text>(" [1, 2] ").text == "[1, 2]");
    BOOST_TEST(!from_json<std::vector<cles::json_text>>("[{\"a\":1},5]").empty());
    BOOST_CHECK_THROW(to_json(cles::json_text{"{\"a\":"}), cles::error);
    BOOST_CHECK_THROW(to_json(cles::json_text{""}), cles::error);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(structs)

BOOST_AUTO_TEST_CASE(a_described_struct_is_an_object_of_its_members_in_their_order) {
    BOOST_TEST(to_json(point{45.1, -7.5}) == "{\"lat\":45.1,\"lon\":-7.5}");
    const auto p = from_json<point>("{\"lat\":45.1,\"lon\":-7.5}");
    BOOST_TEST(p.lat == 45.1);
    BOOST_TEST(p.lon == -7.5);
    BOOST_TEST(to_json(nothing{}) == "{}");
    from_json<nothing>("{\"a\":1}");
}

BOOST_AUTO_TEST_CASE(members_may_come_in_any_order_and_with_white_space_and_escapes) {
    for (const std::string_view text :
         {"{\"lon\":2,\"lat\":1}", " { \"lat\" : 1 , \"lon\" : 2 } ", "{\"l\\u0061t\":1,\"lon\":2}",
          "{\"lat\":1, \"lon\":2}", "{\"lon\":2 ,\"lat\":1}", "{\"lat\":1,\"x\":[{}],\"lon\":2}",
          "{\"x\":3,\"lat\":1,\"lon\":2}", "{\"lat\":1,\"lon\":2,\"x\":3}",
          "{\"lat\":3,\"lon\":3,\"lon\":2,\"lat\":1}"}) {
        const auto p = from_json<point>(text);
        BOOST_TEST(p.lat == 1.0, text);
        BOOST_TEST(p.lon == 2.0, text);
    }
}

BOOST_AUTO_TEST_CASE(unknown_members_are_ignored) {
    const auto p = from_json<point>("{\"alt\":{\"x\":[1,2,\"}\"]},\"lat\":1,\"lat_\":9,\"lon\":2,\"z\":null}");
    BOOST_TEST(p.lat == 1.0);
    BOOST_TEST(p.lon == 2.0);
    BOOST_TEST(why<point>("{\"lat\":1,\"lon\":2,\"z\":}") == "expected a value, got something that is not JSON");
}

BOOST_AUTO_TEST_CASE(of_duplicate_members_the_last_counts) {
    BOOST_TEST(from_json<point>("{\"lat\":1,\"lon\":2,\"lat\":3}").lat == 3.0);
}

BOOST_AUTO_TEST_CASE(a_missing_member_is_an_error_that_names_it_unless_it_is_optional) {
    BOOST_TEST(why<point>("{\"lat\":1}") == "lon: is missing");
    BOOST_TEST(why<point>("{}") == "lat: is missing");
    const std::string rest = "\"name\":\"x\",\"route\":[],\"first\":\"park\",\"limits\":{}";
    BOOST_TEST(!from_json<plan>("{" + rest + "}").lanes.has_value());
    BOOST_TEST(!from_json<plan>("{" + rest + ",\"lanes\":null}").lanes.has_value());
    BOOST_TEST(int{from_json<plan>("{" + rest + ",\"lanes\":3}").lanes.value()} == 3);
}

BOOST_AUTO_TEST_CASE(an_empty_optional_member_is_not_written) {
    BOOST_TEST(to_json(plan{"x", {{1, 2}}, {}, gear::drive, {{"a", 1}}}) ==
               "{\"name\":\"x\",\"route\":[{\"lat\":1,\"lon\":2}],\"first\":\"drive\",\"limits\":{\"a\":1}}");
    BOOST_TEST(to_json(plan{"x", {}, 3, gear::park, {}}) ==
               "{\"name\":\"x\",\"route\":[],\"lanes\":3,\"first\":\"park\",\"limits\":{}}");
}

BOOST_AUTO_TEST_CASE(an_error_names_the_path_to_what_does_not_fit) {
    const auto with = [](std::string_view route) {
        return "{\"name\":\"x\",\"route\":" + std::string{route} +
               ",\"first\":\"park\",\"limits\":{\"a\":1,\"b\":2.5}}";
    };
    BOOST_TEST(why<plan>(with("[{\"lat\":1,\"lon\":2},{\"lat\":\"x\",\"lon\":2}]")) ==
               "route[1].lat: expected a number, got a string");
    BOOST_TEST(why<plan>(with("[{\"lat\":1}]")) == "route[0].lon: is missing");
    BOOST_TEST(why<plan>(with("5")) == "route: expected an array, got a number");
    BOOST_TEST(why<plan>(with("[]")) == "limits.b: expected an integer");
    BOOST_TEST(why<point>("[]") == "expected an object, got an array");
    BOOST_TEST((why<std::vector<std::vector<int>>>("[[1],[2,null]]") == "[1][1]: expected a number, got null"));
}

BOOST_AUTO_TEST_CASE(described_bases_belong_to_the_struct) {
    stamped_point p;
    p.utc = 17;
    p.lat = 1.5;
    p.good = true;
    const auto text = to_json(p);
    for (const std::string_view part : {"\"utc\":17", "\"lat\":1.5", "\"lon\":0", "\"good\":true"}) {
        BOOST_TEST(text.find(part) != std::string::npos, text);
    }
    const auto back = from_json<stamped_point>(text);
    BOOST_TEST(back.utc == 17);
    BOOST_TEST(back.lat == 1.5);
    BOOST_TEST(back.good);
    BOOST_TEST(why<stamped_point>("{\"lat\":1,\"lon\":2,\"good\":true}") == "utc: is missing");
}

BOOST_AUTO_TEST_CASE(described_members_convert_whatever_their_access) {
    const account one{3, "eve", 1.5};
    BOOST_TEST(to_json(one) == R"({"id_":3,"owner_":"eve","balance_":1.5})");
    BOOST_TEST((round_trip(one) == one));
    BOOST_TEST(to_json(savings{}) == R"({"id_":0,"owner_":"","balance_":0,"rate_":0.5})");
    BOOST_TEST(why<account>(R"({"id_":3,"owner_":"eve"})") == "balance_: is missing");
}

BOOST_AUTO_TEST_CASE(members_may_have_other_names) {
    BOOST_TEST(to_json(pose{"car", 2, 3}) == R"({"class":"car","yaw rate, in °/s":2,"plain":3})");
    BOOST_TEST(from_json<pose>(R"({"plain":3,"yaw rate, in °/s":2,"class":"car"})").yaw_rate == 2.0);
    BOOST_TEST(from_json<pose>(R"({"plain":3,"class":"car"})").yaw_rate == 0.5);
    BOOST_TEST(why<pose>(R"({"plain":3,"klass":"car"})") == "class: is missing");
    BOOST_TEST(why<pose>(R"({"plain":3,"class":5})") == "class: expected a string, got a number");
    // Those of a base are kept.
    BOOST_TEST(to_json(stamped_pose{}) == R"({"class":"","yaw rate, in °/s":0.5,"plain":0,"time":0})");
    BOOST_TEST(from_json<stamped_pose>(R"({"class":"","plain":0,"time":7})").utc == 7);
}

BOOST_AUTO_TEST_CASE(a_user_type_is_supported_by_a_specialisation) {
    BOOST_TEST(to_json(std::vector<celsius>{{21.5}, {22}}) == "[21.5,22]");
    BOOST_TEST(from_json<std::vector<celsius>>("[21.5]").at(0).degrees == 21.5);
}

BOOST_AUTO_TEST_CASE(the_whole_text_must_be_read) {
    BOOST_TEST(why<point>("{\"lat\":1,\"lon\":2} x") == "more text after the value");
    BOOST_CHECK_EXCEPTION(from_json<point>("{}"), cles::error, [](const cles::error& e) {
        return e.code() == cles::errc::conversion && e.message().starts_with("lat: is missing");
    });
}

BOOST_AUTO_TEST_CASE(depth_is_limited_while_reading) {
    const auto deep = std::string(33, '[') + std::string(33, ']');
    BOOST_TEST(why<cles::json_text>(deep) == "nested deeper than 32 levels");
}

BOOST_AUTO_TEST_CASE(what_readers_refuse_is_not_written) {
    const auto refused = [](const auto& value) {
        try {
            return to_json(value);
        } catch (const cles::error& e) {
            return e.message();
        }
    };
    tree whole;
    auto* lowest = &whole;
    for (int levels = 2; levels < 34; levels += 2) { // each tree is an object and an array
        lowest = &lowest->below.emplace_back();
    }
    BOOST_TEST(cles::is_valid_json(to_json(whole), cles::json_writer::most_levels));
    lowest->below.emplace_back();
    BOOST_TEST(refused(whole) == "nested deeper than 35 levels");
    for (int i = 0; i < 1000; ++i) { // does not recurse to the end
        lowest = &lowest->below.emplace_back();
    }
    BOOST_TEST(refused(whole) == "nested deeper than 35 levels");

    const cles::json_text deep{std::string(32, '[') + std::string(32, ']')};
    BOOST_TEST(to_json(deep) == deep.text);
    using texts = std::vector<cles::json_text>;
    const std::vector<std::vector<texts>> inside{{{deep}}};
    BOOST_TEST(cles::is_valid_json(to_json(inside), cles::json_writer::most_levels));
    BOOST_TEST(refused(std::vector<std::vector<std::vector<texts>>>{inside}).find("nested deeper than 31") !=
               std::string::npos);

    BOOST_TEST(to_json(passed_on{"[1]"}) == "[1]");
    BOOST_TEST(refused(passed_on{"[1"}).starts_with("what was written is not JSON: "));
    BOOST_TEST(refused(std::vector{passed_on{"1,\"\xFF\""}}).starts_with("what was written is not JSON: "));
    BOOST_TEST(refused(passed_on{"}],{"}).starts_with("what was written is not JSON: "));
    BOOST_TEST(refused(passed_on{"[1,\n2]"}) == "what was written contains a line feed");
    BOOST_TEST(refused(passed_on{std::string(36, '[') + std::string(36, ']')}).find("nested deeper than 35") !=
               std::string::npos);
    BOOST_TEST(refused(std::pair{passed_on{"}"}, std::string{"\xFF"}}).find("not UTF-8") != std::string::npos);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
